"""From where hands may approach an object that lies on a station."""

from __future__ import annotations

import numpy as np

from burg_drake.core import Array, InvalidInputError
from burg_drake.grasping.sampling import ApproachCone
from burg_drake.station.document import Station

DIRECTION_DIGITS = 6
"""Directions in an object's frame are rounded, so that instances of one object that differ by a
turn about the vertical have the same straight down, and share their grasps."""

ABOVE_BASE = 0.01
"""An object that is closer to the vertical through the arm's base is on no side of it [m]."""


def from_above(X_WO: Array, angle_deg: float) -> tuple[ApproachCone, ...]:
    """The cone about straight down, in the object frame.

    Args:
        X_WO: (4, 4) where the object lies.
        angle_deg: largest angle to straight down; nothing is forbidden from 180 on.
    """
    if angle_deg >= 180.0:
        return ()
    return (ApproachCone(_in_object(X_WO, (0.0, 0.0, -1.0)), float(np.deg2rad(angle_deg))),)


def from_arm_side(X_WO: Array, p_WM: Array, station: Station, name: str) -> ApproachCone:
    """The half space of approaches that do not point back to the arm, in the object frame: those
    that make no obtuse angle with the horizontal direction from the arm's base to the object.

    Args:
        X_WO: (4, 4) where the object lies.
        p_WM: (3,) its middle [m].
        station: has the arm.
        name: of the instance, for messages.

    Raises:
        InvalidInputError: there is no arm, or the object is right above its base.
    """
    arm = station.document.arm
    if arm is None:
        raise InvalidInputError(
            f"station {station.name!r} has no arm, so there is no side of the arm from"
            " which the hand could approach"
        )
    x, y, _ = p_WM - arm.X_WA.matrix()[:3, 3]
    if np.hypot(x, y) < ABOVE_BASE:
        raise InvalidInputError(
            f"{name!r} is right above the base of the arm, so the hand cannot approach it"
            " from the arm's side"
        )
    return ApproachCone(_in_object(X_WO, (x, y, 0.0)), np.pi / 2)


def _in_object(X_WO: Array, v_W: tuple[float, float, float]) -> tuple[float, float, float]:
    """A direction of the world as a rounded unit vector in the object frame."""
    v_O = np.asarray(v_W) @ X_WO[:3, :3] / np.linalg.norm(v_W)
    x, y, z = np.round(v_O, DIRECTION_DIGITS) + 0.0  # no negative zeros
    return float(x), float(y), float(z)
