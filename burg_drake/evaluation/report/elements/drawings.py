"""Drawings of a run: the scene with what was lifted of each object, and each object's grasps.

They are projections of the meshes and of grasp glyphs as SVG: exact, small, sharp on paper, with a
dark mode, and the same on machines with and without a renderer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, make_pose, rot_z, transform_points
from burg_drake.evaluation.report.elements.blocks import Html, element, join
from burg_drake.evaluation.report.elements.outcome_groups import LIFTED
from burg_drake.evaluation.report.elements.style import STYLES
from burg_drake.scene.document import Scene
from burg_drake.visualization.grasps import grasp_corners, grasp_strokes
from burg_drake.visualization.meshcat import best_yaw, camera_rotation
from burg_drake.visualization.pictures import (
    FlatView,
    SolidMesh,
    fit_view,
    footprint,
    grounded,
    path_data,
    shaded_outline,
    surface_of,
)
from burg_drake.visualization.style import GROUPS

SCENE_WIDTH = 480.0
SCENE_ELEVATION = float(np.deg2rad(56.0))
ELEVATION = float(np.deg2rad(30.0))
"""By which the cameras look down: over a whole scene, and at one object [rad]."""
PANEL = 220.0
CAPTION, FOOT = 22.0, 16.0
"""Side of a picture of grasps, heights of the line above it and of its scale [SVG units]."""
RULER = 0.05
"""Length of the scale in pictures of grasps [m]."""
NAMED = 16
"""Scenes of more objects have no names in their picture."""


@dataclass(frozen=True, eq=False)
class DrawnGrasps:
    """Grasps on one instance, to be drawn.

    Attributes:
        ids: (N,) of the run.
        X_OG: (N, 4, 4) in the object frame.
        width: (N,) distance between the fingers [m].
        groups: (N,) indices into `palette.GROUPS`.
        counts: how many there are of all groups, drawn or not, by index.
    """

    ids: NDArray[np.str_]
    X_OG: Array
    width: Array
    groups: NDArray[np.int8]
    counts: Mapping[int, int]


def solid_of(scene: Scene, name: str) -> SolidMesh:
    """An instance's surface in the scene frame."""
    surface = surface_of(scene.library, scene.instance(name).object)
    return SolidMesh(transform_points(scene.X_SO(name), surface.vertices), surface.faces)


def scene_drawing(
    scene: Scene,
    free: Mapping[str, SolidMesh],
    fixed: Mapping[str, SolidMesh],
    notes: Mapping[str, str],
) -> Html:
    """The scene, seen from the near edge of the board, with names.

    Args:
        scene: for its board.
        free, fixed: its instances by name.
        notes: a short text for each free instance, below its name.
    """
    dx, dy = scene.board.size
    board = np.array([[0, 0, 0], [dx, 0, 0], [dx, dy, 0], [0, dy, 0]], dtype=float)
    R_SC = camera_rotation(SCENE_ELEVATION)
    everything = np.vstack([board, *(s.vertices for s in (*free.values(), *fixed.values()))])
    view = fit_view(everything, R_SC, SCENE_WIDTH)
    labels = [_label(view, solid, name, notes.get(name, "")) for name, solid in free.items()]
    behind = shaded_outline(list(fixed.values()), view)
    width, height = view.size
    return element(
        "svg",
        element("path", d=path_data(view.places(board)), class_="board"),
        *(element("path", d=d, class_="fixed") for d in behind[:1] if d),
        *(element("path", d=footprint(s, view), class_="ground") for s in free.values()),
        *_tones(list(free.values()), view),
        *(labels if len(free) <= NAMED else []),
        viewBox=f"0 0 {width:g} {height:g}",
        class_="drawing scene",
        role="img",
        aria_label=f"The scene with {len(free)} objects: {', '.join(free)}",
    )


def grasp_drawing(name: str, solid: SolidMesh, X_SO: Array, grasps: DrawnGrasps) -> Html:
    """An instance as it stands in the scene, twice: with the grasps that lifted it, and with all
    others in the colours of their outcomes. Every grasp is one path.

    Args:
        name: of the instance.
        solid: in the scene frame.
        X_SO: (4, 4) its pose there.
        grasps: to draw.
    """
    R_WC = camera_rotation(ELEVATION)
    X_WS = make_pose(rot_z(best_yaw(solid.vertices - solid.vertices.mean(axis=0), R_WC)))
    turned = SolidMesh(transform_points(X_WS, solid.vertices), solid.faces)
    corners = grasp_corners(X_WS @ X_SO @ grasps.X_OG, grasps.width)
    everything = np.vstack([turned.vertices, grounded(turned), corners.reshape(-1, 3)])
    view = fit_view(everything, R_WC, PANEL, PANEL)
    behind = join(
        element("path", d=footprint(turned, view), class_="ground"), *_tones([turned], view)
    )
    lifted = grasps.groups == LIFTED
    counts = grasps.counts.get(LIFTED, 0), sum(n for k, n in grasps.counts.items() if k != LIFTED)
    panels = []
    for place, (mask, text, count) in enumerate(
        ((lifted, "lifted", counts[0]), (~lifted, "not lifted", counts[1]))
    ):
        number = f"{count:,}" if count else "none"
        panel = (
            element("text", f"{text}: {number}", x=PANEL / 2, y=15, class_="panel"),
            element(
                "g",
                behind,
                *_strokes(grasps, mask, corners, view),
                _ruler(view),
                transform=f"translate(0 {CAPTION:g})",
            ),
        )
        panels.append(element("g", *panel, transform=f"translate({place * PANEL:g} 0)"))
    return element(
        "svg",
        *panels,
        viewBox=f"0 0 {2 * PANEL:g} {CAPTION + PANEL + FOOT:g}",
        class_="drawing grasps",
        role="img",
        aria_label=f"Grasps on {name}: {counts[0]} lifted it, {counts[1]} did not",
    )


def _strokes(
    grasps: DrawnGrasps, mask: NDArray[np.bool_], corners: Array, view: FlatView
) -> list[Html]:
    """One group of paths for each outcome group, the best ones last and so on top; within a group
    the nearer grasps on top."""
    found = []
    depth = view.depths(corners[:, 0])
    for k in sorted(set(grasps.groups[mask].tolist()), reverse=True):
        members = np.flatnonzero(mask & (grasps.groups == k))
        members = members[np.argsort(-depth[members], kind="stable")]
        paths = [
            element("path", element("title", f"{grasps.ids[i]}"), d=d)
            for i, d in zip(members.tolist(), grasp_strokes(corners[members], view), strict=True)
        ]
        found.append(element("g", *paths, class_=f"grasp {STYLES[GROUPS[k].name]}"))
    return found


def _tones(solids: Sequence[SolidMesh], view: FlatView) -> list[Html]:
    paths = shaded_outline(solids, view)
    return [element("path", d=d, class_=f"tone t{k}") for k, d in enumerate(paths) if d]


def _ruler(view: FlatView) -> Html:
    length = RULER * view.scale
    x, y = PANEL - 8 - length, PANEL + FOOT - 3
    return element(
        "g",
        element("line", x1=f"{x:.1f}", x2=f"{x + length:.1f}", y1=y, y2=y),
        element("text", f"{100 * RULER:g} cm", x=f"{x + length / 2:.1f}", y=y - 4),
        class_="ruler",
    )


def _label(view: FlatView, solid: SolidMesh, name: str, note: str) -> Html:
    places = view.places(solid.vertices)
    x, y = (places.min(axis=0) + places.max(axis=0)) / 2.0
    lines = [element("tspan", name, x=f"{x:.1f}", class_="name")]
    if note:
        lines.append(element("tspan", note, x=f"{x:.1f}", dy="1.15em"))
    return element("text", *lines, x=f"{x:.1f}", y=f"{y:.1f}", class_="label")
