"""What tells of a trial how near its verdict was to the other one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array
from burg_drake.core.grasps import Margins

GRAVITY = 9.81
RIM = 0.0066
"""Lever of a pad's friction about the closing direction [m]: about two thirds of the radius of a
disc as large as the front of the Panda's pads, 17.5 x 18.5 mm, which is 6.8 mm. The curves are
fitted with this value."""
SMALLEST_SLIP, SMALLEST_TILT = 1e-7, 1e-5
"""What is below sticks [m, rad]."""
LARGEST_USE = 20.0
"""Friction that would be needed over what there is; more tells nothing more."""
FAR = 0.4
"""Logarithm of a load over what friction carries that is far from the limit."""


@dataclass(frozen=True)
class GripLoad:
    """What a grip has to carry, and with what.

    Attributes:
        friction: coefficient between pads and target.
        force: of each finger [N].
        mass: of the target [kg].
        acceleration: of the lift [m/s^2].
        lever: distance of the centre of mass from the closing axis, seen along the vertical, across
            that axis [m].
    """

    friction: float
    force: float
    mass: float
    acceleration: float
    lever: float

    @classmethod
    def of(
        cls,
        X_WG: Array,
        p_WCm: Array,
        *,
        friction: float,
        force: float,
        mass: float,
        acceleration: float,
    ) -> GripLoad:
        """Of a target where it stands.

        Args:
            X_WG: (4, 4) grasp in the world.
            p_WCm: (3,) centre of mass in the world [m].
            friction, force, mass, acceleration: see the attributes.
        """
        weight = np.array([0.0, 0.0, -1.0])
        moment = np.cross(p_WCm - X_WG[:3, 3], weight) @ X_WG[:3, 0]
        return cls(friction, force, mass, acceleration, abs(float(moment)))

    @property
    def carried(self) -> float:
        """The load over what the friction of two pads carries."""
        return self._share(self.mass * (GRAVITY + self.acceleration))

    @property
    def turned(self) -> float:
        """The moment of the load about the closing axis over what friction carries of it."""
        return self._share(self.mass * (GRAVITY + self.acceleration) * self.lever / RIM)

    @property
    def limit(self) -> float:
        """How far the load is from what friction carries at most: size of the logarithm of their
        ratio, to the base of 10, `FAR` at most. At its limit a load that hangs straight below the
        pads slides down; one that turns more than it pulls comes to hang below them, and is held.
        """
        if self.turned > self.carried:
            return FAR
        return min(FAR, abs(math.log10(max(math.hypot(self.carried, self.turned), 1e-3))))

    def _share(self, force: float) -> float:
        limit = 2.0 * self.friction * self.force
        return min(LARGEST_USE, force / limit) if limit > 0.0 else LARGEST_USE


def grip_signs(margins: Margins, load: GripLoad) -> Mapping[str, float]:
    """Signs of a verdict, by name; logarithms are to the base of 10.

    Args:
        margins: of a trial, with its end counted from where the fingers met the target.
        load: of its grip.

    Returns:
        `carried`, `turned`: logarithms of the load's shares in what friction carries; `limit`: see
        `GripLoad.limit`; `slip`, `tilt`: logarithms of the motion in the hand [m, rad];
        `pad_force`: share of the weaker pad's force in that of the hand; `patch_area`: square root
        [m]; `lift`: how far the target went with the hand [m]; `end_time`: how long after the
        fingers met the target it was decided [s]. What was not measured, as there was no grip, is
        0.
    """

    def measured(value: float) -> float:
        return value if math.isfinite(value) else 0.0

    return {
        "carried": math.log10(max(load.carried, 1e-3)),
        "turned": math.log10(max(load.turned, 1e-3)),
        "limit": load.limit,
        "slip": math.log10(max(measured(margins.slip), SMALLEST_SLIP)),
        "tilt": math.log10(max(measured(margins.tilt), SMALLEST_TILT)),
        "pad_force": measured(margins.pad_force) / load.force,
        "patch_area": math.sqrt(measured(margins.patch_area)),
        "lift": measured(margins.lift),
        "end_time": measured(margins.end_time),
    }
