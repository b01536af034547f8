"""How grasps are sampled on the objects of a scene or library."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from burg_drake.core import MILLIMETRES, InvalidInputError, setting

if TYPE_CHECKING:
    from burg_drake.core import Array

DEFAULT_APPROACH_ANGLE_DEG = 75.0
"""Keeps the hand above the horizontal, and leaves out pairs of an object's bottom and top for
friction up to tan(15 deg) = 0.27: one of the two fingers would be below the table."""

SLIPPERY_FRICTION_FACTOR = 4.0
"""Slippery grasps need up to so many times the friction that there is. On the objects of
`tabletop_six` two thirds of them fail in simulation, where a tenth of ordinary ones do; with 2 a
sixth fails, and none on two of the objects."""


@dataclass(frozen=True, kw_only=True)
class SamplingSettings:
    """How grasps are sampled on each object; more on these in `grasping.sampling.antipodal`.

    Example::

        wide = burg.SamplingSettings(approach_angle_deg=90.0)
        burg.sample_grasps("tabletop_six", "panda_tabletop", 20, settings=wide)

    Attributes:
        friction: coefficient; the object's own if None.
        approaches: approach angles for each pair of contacts.
        approach_angle_deg: in a scene, largest angle between the approach and straight down, above
            0 to 180; with 180 the hand comes from anywhere. `DEFAULT_APPROACH_ANGLE_DEG` if None.
        from_arm_side: in a scene, the approach has no part that points back to the arm: its inner
            product with the horizontal direction from the arm's base to the middle of the object
            is not negative.
        standoffs: distances between G and the contacts that every pose is given with [m].
        weights: density of contacts on the faces (F,) of `ObjectLibrary.surface`, by object.
        blind: know only points of contact, not the hand, as published samplers do. Otherwise the
            open hand overlaps nothing at the grasps, in a scene neither the object nor anything
            else, in a library not the object; and its pads, all that they meet of the object,
            touch it within the friction cones.
        margin: unless `blind`, least signed clearance that a grasp has to have [m].
        conservative: unless `blind`, the screen's mode of that name: faster, but it leaves out a
            tenth of the clear grasps.
        diverse: of this many times n grasps the most diverse n are kept.
        slippery: only grasps that the friction does not hold at both points of contact: they need
            more than there is, up to `SLIPPERY_FRICTION_FACTOR` times as much, and their scores are
            below 0. Many of them fail in simulation. There are fewer than n, as some of the n that
            are sampled need less.
    """

    friction: float | None = setting(
        None, "friction coefficient (default: the object's)", metavar="MU", above=0
    )
    approaches: int = setting(
        1, "approach directions for each pair of contacts", metavar="K", low=1
    )
    approach_angle_deg: float | None = None
    from_arm_side: bool = setting(
        False, "in a scene, leave out approaches that point back to the arm"
    )
    standoffs: tuple[float, ...] = (0.0,)
    weights: Mapping[str, Array] = field(default_factory=dict)
    blind: bool = False
    margin: float = setting(0.0, "smallest clearance of the open hand", unit=MILLIMETRES, low=0)
    conservative: bool = setting(
        False, "faster clearance test that loses a tenth of the clear grasps"
    )
    diverse: int = setting(
        1, "sample K times as many, keep those farthest apart", metavar="K", low=1
    )
    slippery: bool = False

    def __post_init__(self) -> None:
        angle = self.approach_angle_deg
        if angle is not None and not 0.0 < angle <= 180.0:
            raise InvalidInputError(
                f"approach angle is {angle:g} degrees; give more than 0, at most 180"
            )
        if not 0.0 <= self.margin < math.inf:
            raise InvalidInputError(f"margin is {self.margin} m; give a clearance of 0 or more")
        if (self.margin or self.conservative) and self.blind:
            raise InvalidInputError(
                "margin and conservative concern the hand, which blind sampling ignores;"
                " leave them out, or do not sample blindly"
            )
