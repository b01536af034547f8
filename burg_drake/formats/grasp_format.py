"""Description of a grasp file format: its frame, its gripper, and the columns that it cannot carry.

A format is an instance of `GraspFormat` in a module of its own; `formats.grasp_files` lists them.
Frames are those of `core.frames`: G is the grasp frame of burg_drake, H the frame of the hand's
body, F the grasp frame of the format.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import Array, GraspSet, inverse, list_names, make_pose, rot_z

PoseFrame = Literal["object", "world", "camera"]
"""Reference frame of the grasp poses of a file."""

PREGRASP_WIDTH_COLUMN = "pregrasp_width"
"""Column: opening of the hand on arrival, in metres; NaN if unknown."""


@dataclass(frozen=True)
class GripperJoint:
    """A joint that moves a finger.

    Attributes:
        name: name of the joint.
        closed: position with the pads at the smallest distance [m].
        open: position with the pads at the largest distance [m].
    """

    name: str
    closed: float
    open: float


@dataclass(frozen=True, eq=False)
class Gripper:
    """Properties of a parallel hand that formats need.

    Attributes:
        name: the hand's name.
        body: link of the hand whose frame is H.
        X_HG: (4, 4) grasp frame in H.
        tip: distance from G to the finger tips along the approach [m].
        opening: smallest and largest distance between the pads [m].
        joints: finger joints; their positions are linear in the distance between the pads.
    """

    name: str
    body: str
    X_HG: Array
    tip: float
    opening: tuple[float, float]
    joints: tuple[GripperJoint, ...]

    @property
    def X_GH(self) -> Array:
        """(4, 4) pose of the hand's body in G."""
        return inverse(self.X_HG)

    @property
    def X_GB(self) -> Array:
        """(4, 4) pose in G of the hand's base as defined by several projects: the origin of H, the
        axes of G."""
        return make_pose(p_AB=self.X_GH[:3, 3])

    def positions(self, width: ArrayLike) -> dict[str, Array]:
        """Positions (...) [m] by joint at which the pads are `width` (...) [m] apart."""
        low, high = self.opening
        share = (np.asarray(width, dtype=float) - low) / (high - low)
        return {j.name: j.closed + share * (j.open - j.closed) for j in self.joints}

    def width(self, positions: Mapping[str, ArrayLike]) -> Array:
        """Distance between the pads (...) [m] at positions (...) of some of the joints.

        It is the mean over the given joints, at least one.
        """
        low, high = self.opening
        shares = [
            (np.asarray(positions[j.name], dtype=float) - j.closed) / (j.open - j.closed)
            for j in self.joints
            if j.name in positions
        ]
        return np.asarray(low + (high - low) * np.mean(shares, axis=0))


PANDA_GRIPPER = Gripper(
    name="panda_hand",
    body="panda_hand",
    X_HG=make_pose(rot_z(np.pi / 2), (0.0, 0.0, 0.1034)),
    tip=0.0095,
    opening=(0.0, 0.08),
    joints=(
        GripperJoint("panda_finger_joint1", 0.0, 0.04),
        GripperJoint("panda_finger_joint2", 0.0, 0.04),
    ),
)
"""The Franka Hand, as in models/hands/panda_hand.yaml (franka_ros, franka_hand.xacro)."""


@dataclass(frozen=True, eq=False)
class ImportedGrasps:
    """Grasps read from a file.

    Attributes:
        grasps: `X_OG` has the poses of G in `frame`.
        frame: reference frame of the poses.
        notes: data of the file that were ignored or changed, one sentence each.
    """

    grasps: GraspSet
    frame: PoseFrame
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class GraspFormat:
    """A kind of grasp file.

    Attributes:
        name: name in options, such as `acronym`.
        title: display name.
        suffixes: suffixes of its files, such as `.h5`; files are written with the first one.
        frame: reference frame of grasp poses.
        source: definition of the format: repository and file, or paper.
        carries: data of a grasp that it has besides the pose.
        cannot_carry: data that are lost on writing.
        X_GF: (4, 4) pose of the format's grasp frame F in our grasp frame G, for a gripper.
        recognises: whether a file has this format, by its content; False for unreadable files.
        read: reads the grasps of a file made for a gripper.
        write: writes grasps of a gripper and returns notes on data that the file cannot carry.
        one_object: whether a file holds the grasps of only one object.
        X_GF_each: (N, 4, 4) poses of F in G for each grasp of a set that was read, if they differ.
    """

    name: str
    title: str
    suffixes: tuple[str, ...]
    frame: PoseFrame
    source: str
    carries: tuple[str, ...]
    cannot_carry: tuple[str, ...]
    X_GF: Callable[[Gripper], Array]
    recognises: Callable[[Path], bool]
    read: Callable[[Path, Gripper], ImportedGrasps]
    write: Callable[[GraspSet, Path, Gripper], tuple[str, ...]]
    one_object: bool = False
    X_GF_each: Callable[[GraspSet, Gripper], Array] | None = None

    def frames(self, grasps: GraspSet, gripper: Gripper) -> Array:
        """(N, 4, 4) poses of the format's grasp frame F in G, for each grasp read from a file."""
        if self.X_GF_each is not None:
            return self.X_GF_each(grasps, gripper)
        return np.broadcast_to(self.X_GF(gripper), (len(grasps), 4, 4))


def file_provenance(format: GraspFormat, path: Path, **more: Any) -> dict[str, Any]:
    """Provenance of grasps read from a file."""
    return {"format": format.name, "file": str(path.absolute()), **more}


def conversion_losses(grasps: GraspSet, carried: Collection[str], title: str) -> tuple[str, ...]:
    """A sentence about the columns that are lost, including `id`; empty if none is lost.

    Args:
        grasps: grasps to write.
        carried: columns that the file can hold.
        title: display name of the format.
    """
    lost = [
        name
        for name in grasps.column_names
        if name not in carried and _has_values(grasps.column(name))
    ]
    return (f"{title} has no place for {list_names(lost)}.",) if lost else ()


def _has_values(values: NDArray[Any]) -> bool:
    if values.dtype.kind == "U":
        return bool((values != "").any())
    return values.dtype.kind != "f" or bool(np.isfinite(values).any())


@dataclass(frozen=True)
class Convention:
    """The grasp frame F of a format for a hand.

    Attributes:
        approach: the axis of F along which the hand approaches, such as `+z`.
        closing: the axis of F along which the fingers close, such as `x`; without sign, as fingers
            are exchangeable.
        origin: origin of F in words.
    """

    approach: str
    closing: str
    origin: str


def convention_of(format: GraspFormat, gripper: Gripper) -> Convention:
    """The convention of a format for a gripper."""
    X_GF = format.X_GF(gripper)
    return Convention(
        approach=axis_along(X_GF, (0.0, 0.0, 1.0)),
        closing=axis_along(X_GF, (1.0, 0.0, 0.0)).removeprefix("+").removeprefix("-"),
        origin=origin_in_words(X_GF[:3, 3], gripper),
    )


def group_by_convention(
    formats: Iterable[GraspFormat], gripper: Gripper
) -> list[tuple[GraspFormat, ...]]:
    """Groups formats with the same grasp frame convention."""
    groups: list[list[GraspFormat]] = []
    for format in formats:
        for group in groups:
            same = np.allclose(group[0].X_GF(gripper), format.X_GF(gripper), rtol=0.0, atol=1e-6)
            if same and group[0].frame == format.frame:
                group.append(format)
                break
        else:
            groups.append([format])
    return [tuple(group) for group in groups]


def axis_along(X_GF: Array, direction: tuple[float, float, float]) -> str:
    """The axis of F that is nearest to a direction in G.

    Args:
        X_GF: (4, 4) pose of F in G.
        direction: (3,) unit vector in G.

    Returns:
        Axis such as `+z`, or `+z, 12 deg off`.
    """
    along = X_GF[:3, :3].T @ np.asarray(direction)
    k = int(np.argmax(np.abs(along)))
    name = ("+" if along[k] > 0.0 else "-") + "xyz"[k]
    across = float(np.linalg.norm(np.delete(along, k)))
    if across < 1e-6:
        return name
    return f"{name}, {np.rad2deg(np.arctan2(across, abs(along[k]))):.3g} deg off"


def origin_in_words(p_GF: Array, gripper: Gripper) -> str:
    """Describes the position of a point relative to G.

    Args:
        p_GF: (3,) position of the point [m].
        gripper: gripper whose landmarks, H and the finger tips, are named.
    """
    x, y, z = p_GF
    places = []
    if abs(z) >= 1e-6:
        places.append(f"{1e3 * abs(z):.4g} mm {'ahead of' if z > 0.0 else 'behind'} G")
    for axis, offset in (("x", x), ("y", y)):
        if abs(offset) >= 1e-6:
            sign = "-" if offset < 0.0 else ""
            places.append(f"{1e3 * abs(offset):.4g} mm along {sign}{axis} of G")
    if not places:
        return "G"
    landmarks = {"H": gripper.X_GH[:3, 3], "finger tips": np.array([0.0, 0.0, gripper.tip])}
    for name, p_GL in landmarks.items():
        if np.linalg.norm(p_GF - p_GL) < 1e-6:
            return f"{name}, {', '.join(places)}"
    return ", ".join(places)
