"""The grasp frame of a format in words: origin, approach axis and closing axis."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array
from burg_drake.formats.grasp_format import GraspFormat, Gripper


@dataclass(frozen=True)
class Convention:
    """The grasp frame F of a format for a hand.

    Attributes:
        approach: the axis of its frame F that points where the hand moves, such as `+z`.
        closing: the axis of F along which the fingers close, such as `x`; either way, as fingers
            are exchangeable.
        origin: where F has its origin.
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
    """Formats that say where a grasp is in the same way, put together."""
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
        X_GF: (4, 4).
        direction: (3,) of unit length, in G.

    Returns:
        Such as `+z`, or `+z, 12 deg off`.
    """
    along = X_GF[:3, :3].T @ np.asarray(direction)
    k = int(np.argmax(np.abs(along)))
    name = ("+" if along[k] > 0.0 else "-") + "xyz"[k]
    across = float(np.linalg.norm(np.delete(along, k)))
    if across < 1e-6:
        return name
    return f"{name}, {np.rad2deg(np.arctan2(across, abs(along[k]))):.3g} deg off"


def origin_in_words(p_GF: Array, gripper: Gripper) -> str:
    """Where a point is, from G.

    Args:
        p_GF: (3,) [m].
        gripper: whose landmarks are named: H and the finger tips.
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
