"""Grasp frames of file formats in Meshcat: an open hand for each, with our frame G and its F."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.geometry import Box, Mesh, Meshcat, Rgba
from pydrake.math import RigidTransform

from burg_drake.core import Array, make_pose, rot_z, transform_points
from burg_drake.formats import GraspFormat, Gripper, convention_of, group_by_convention
from burg_drake.station import Hand
from burg_drake.visualization.gltf import draw_label, label_mesh
from burg_drake.visualization.hand_visual import HandVisual, hand_visuals
from burg_drake.visualization.legend import LegendEntry
from burg_drake.visualization.library_gallery import GALLERY_FIELD_OF_VIEW_DEG
from burg_drake.visualization.meshcat_drawing import VIEW_ASPECT, TriadStyle, aim_at, draw_triad
from burg_drake.visualization.object_drawing import camera_rotation

FRAMES_PATH = "/drake/frames"  # Path of the grasp frames in Meshcat's tree.
R_WC = camera_rotation(np.deg2rad(22.0))
"""(3, 3) axes of the camera in the world."""
X_LT = make_pose(R_WC @ np.diag([1.0, -1.0, -1.0]))
"""(4, 4) pose of text that faces the camera; the axes of L are those of the world."""
OWN_TRIAD = TriadStyle(length=0.066, radius=0.0009, head=0.007)
"""Style of our grasp frame G: thin and long."""
FORMAT_TRIAD = TriadStyle(length=0.044, radius=0.0026, head=0.013)
"""Style of a format's grasp frame F: thick and short, visible where it coincides with G."""


LETTER_HEIGHT = 0.017
"""Height of an axis's letter, in metres."""
CAPTION_HEIGHT = 0.0155
"""Distance from line to line of a caption, in metres."""


@dataclass(frozen=True)
class FrameGrid:
    """A grid of cells in the picture.

    Attributes:
        columns, rows: numbers of cells.
        width, height: size of a cell [m].
        foot, head: lower and upper end of a cell's contents, upwards from G [m].
    """

    columns: int
    rows: int
    width: float
    height: float
    foot: float
    head: float

    def place(self, index: int) -> tuple[float, float]:
        """Position of a hand's G in the picture, to the right and up [m]."""
        row, column = divmod(index, self.columns)
        return self.width * column, -self.height * row

    def bounds(self) -> Array:
        """(2, 2) lower and upper corner of the grid in the picture [m]."""
        left, right = -0.5 * self.width, self.width * (self.columns - 0.5)
        return np.array([[left, self.foot - self.height * (self.rows - 1)], [right, self.head]])


def show_frames(
    hand: Hand, model: Path, gripper: Gripper, formats: Sequence[GraspFormat], meshcat: Meshcat
) -> tuple[LegendEntry, ...]:
    """Shows a hand for each grasp frame convention of the formats, with both frames.

    Args:
        hand: document of the hand.
        model: model file of the hand.
        gripper: the hand as formats describe it.
        formats: at least one format.
        meshcat: Meshcat to draw in; anything below `/drake/frames` is replaced.

    Returns:
        Switches for frames, hands and objects.

    Raises:
        InvalidInputError: the hand's model cannot be loaded.
    """
    meshcat.Delete(FRAMES_PATH)
    visuals = hand_visuals(hand, model, opacity=0.36)
    groups = group_by_convention(formats, gripper)
    captions = [_format_caption(group, gripper) for group in groups]
    sheet = _fit_grid(len(groups), *_hand_bounds(visuals, hand), max(w for _, w in captions))
    for k, (group, caption) in enumerate(zip(groups, captions, strict=True)):
        name, (u, v) = group[0].name, sheet.place(k)
        X_WG = pose_in_picture_plane(u, v) @ downward_grasp_pose()
        for i, visual in enumerate(visuals):
            path, X_WV = f"{FRAMES_PATH}/hands/{name}/{i}", hand.X_AH(X_WG) @ visual.X_HV
            meshcat.SetObject(path, visual.shape, visual.color)
            meshcat.SetTransform(path, RigidTransform(X_WV))
        _draw_object(meshcat, f"{FRAMES_PATH}/objects/{name}", hand, X_WG)
        X_WF = X_WG @ group[0].X_GF(gripper)
        draw_triad(meshcat, f"{FRAMES_PATH}/G/{name}", X_WG, OWN_TRIAD)
        draw_triad(meshcat, f"{FRAMES_PATH}/F/{name}", X_WF, FORMAT_TRIAD)
        _write_letters(meshcat, f"{FRAMES_PATH}/labels/{name}", X_WF)
        foot = pose_in_picture_plane(u, v + sheet.foot)
        draw_label(meshcat, f"{FRAMES_PATH}/labels/{name}/caption", caption, foot @ X_LT)
    _aim_at_bounds(meshcat, sheet.bounds())
    entries = (
        ("F, the frame of the format: thick, with letters", "#1f52cc", "F"),
        ("G, the frame of burg_drake: thin", "#8a99c0", "G"),
        ("hand", "#c9ced4", "hands"),
        ("object", "#edc26b", "objects"),
        ("names", "#34393f", "labels"),
    )
    return tuple(LegendEntry(text, c, (f"{FRAMES_PATH}/{name}",)) for text, c, name in entries)


def downward_grasp_pose() -> Array:
    """(4, 4) pose of G that approaches along -z of the world, at the origin."""
    hand_yaw = np.deg2rad(-28.0)  # Radians. No axis of G points at the camera.
    return make_pose(rot_z(hand_yaw) @ np.diag([1.0, -1.0, -1.0]))


def pose_in_picture_plane(u: float, v: float) -> Array:
    """(4, 4) pose at a point of the picture plane through W, with the world's axes.

    Args:
        u, v: coordinates to the right and up in the picture [m].
    """
    return make_pose(p_AB=u * R_WC[:, 0] - v * R_WC[:, 1])


def _fit_grid(count: int, lower: Array, upper: Array, caption: float) -> FrameGrid:
    """The grid whose numbers of columns and rows let the camera come nearest.

    Args:
        count: number of hands.
        lower, upper: (2,) bounds of a hand in the picture, around G [m].
        caption: width of the widest caption [m].
    """
    gap = 0.035  # Metres between neighbours.
    caption_lines = 4
    foot = float(lower[1]) - caption_lines * CAPTION_HEIGHT
    width = max(float(upper[0] - lower[0]), caption) + gap
    height = float(upper[1]) - foot + gap
    grids = [(columns, -(-count // columns)) for columns in range(1, count + 1)]
    columns, rows = min(grids, key=lambda g: max(g[0] * width / VIEW_ASPECT, g[1] * height))
    return FrameGrid(columns, rows, width, height, foot, float(upper[1]))


def _hand_bounds(visuals: Sequence[HandVisual], hand: Hand) -> tuple[Array, Array]:
    """Lower and upper corner (2,) in the picture of a hand with its axes, centred on G [m]."""
    X_WH = hand.X_AH(downward_grasp_pose())
    points = [transform_points(X_WH @ v.X_HV, v.corners) for v in visuals]
    margin = max(OWN_TRIAD.length + 0.5 * CAPTION_HEIGHT, FORMAT_TRIAD.length + LETTER_HEIGHT)
    seen = np.vstack([*points, [[0.0, 0.0, -margin]]]) @ R_WC[:, :2] * (1.0, -1.0)
    lower, upper = seen.min(axis=0), seen.max(axis=0)
    half = max(-lower[0], upper[0])
    return np.array([-half, lower[1]]), np.array([half, upper[1]])


def _format_caption(formats: Sequence[GraspFormat], gripper: Gripper) -> tuple[Mesh, float]:
    found = convention_of(formats[0], gripper)
    lines = (
        ", ".join(format.name for format in formats),
        f"approach {found.approach}, closing {found.closing}",
        f"origin: {found.origin}",
        f"poses in the {formats[0].frame} frame",
    )
    return label_mesh(lines, CAPTION_HEIGHT)


def _draw_object(meshcat: Meshcat, path: str, hand: Hand, X_WG: Array) -> None:
    object_color = Rgba(0.93, 0.70, 0.25, 0.5)
    x, y, z = hand.opening[1] * np.array([0.34, 0.24, 0.40])
    meshcat.SetObject(path, Box(x, y, z), object_color)
    X_GO = make_pose(p_AB=(0.0, 0.0, 0.25 * z))
    meshcat.SetTransform(path, RigidTransform(X_WG @ X_GO))


def _write_letters(meshcat: Meshcat, path: str, X_WF: Array) -> None:
    """Writes x, y, z beyond the tips of a frame's axes."""
    for k, letter in enumerate("xyz"):
        middle = X_WF[:3, 3] + (FORMAT_TRIAD.length + 0.5 * LETTER_HEIGHT) * X_WF[:3, k]
        foot = make_pose(p_AB=middle + 0.4 * LETTER_HEIGHT * R_WC[:, 1])
        draw_label(meshcat, f"{path}/{letter}", label_mesh((letter,), LETTER_HEIGHT), foot @ X_LT)


def _aim_at_bounds(meshcat: Meshcat, bounds: Array) -> None:
    """Fits corners (2, 2) of the picture into the view."""
    corners = np.array(
        [pose_in_picture_plane(u, v)[:3, 3] for u in bounds[:, 0] for v in bounds[:, 1]]
    )
    aim_at(meshcat, corners, R_WC[:, 2], field_of_view_deg=GALLERY_FIELD_OF_VIEW_DEG)
