"""Collision shapes in the frame of their link B, and the name of the pads among them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

PAD = "pad"
"""Collision geometry of each finger that touches the object: a box with a mesh of its own."""


@dataclass(frozen=True)
class Box:
    """Box of `size` [m], centred at `p_BG`, turned by `rpy` [rad] in the link frame B."""

    name: str
    size: tuple[float, float, float]
    p_BG: tuple[float, float, float]
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Capsule:
    """All points within `radius` [m] of the segment from `p_BStart` to `p_BEnd`."""

    name: str
    radius: float
    p_BStart: tuple[float, float, float]
    p_BEnd: tuple[float, float, float]


@dataclass(frozen=True)
class Cylinder:
    """Cylinder of `radius` [m] from the centre of one end to that of the other."""

    name: str
    radius: float
    p_BStart: tuple[float, float, float]
    p_BEnd: tuple[float, float, float]


Shape = Box | Capsule | Cylinder


def mirrored_finger(boxes: tuple[Box, ...]) -> tuple[Box, ...]:
    """The same boxes turned by 180 deg about z: the right finger from the left one.

    Only the pad's mesh is not its own image, so that only the pad is turned in its frame.
    """
    return tuple(
        Box(
            b.name,
            b.size,
            (-b.p_BG[0], -b.p_BG[1], b.p_BG[2]),
            (-b.rpy[0], 0.0, np.pi if b.name == PAD else 0.0),
        )
        for b in boxes
    )


def axis_pose(shape: Capsule | Cylinder) -> tuple[np.ndarray, np.ndarray, float]:
    """Centre (3,) [m], roll-pitch-yaw (3,) [rad] and length [m] of a shape whose axis is z."""
    start, end = np.asarray(shape.p_BStart), np.asarray(shape.p_BEnd)
    axis = end - start
    length = float(np.linalg.norm(axis))
    x, y, z = axis / length
    # R = Rz(yaw) Ry(pitch) takes z to the axis.
    rpy = np.array([0.0, np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)])
    return (start + end) / 2, rpy, length
