"""The hand and the phases of a trial, in numbers: what oracle and engine have in common.

The figures are those of `models/panda/panda_hand.sdf`, `models/hands/panda_hand.yaml` and the
default settings of a trial, written down again. Everything is in the grasp frame G: midway between
the pads, +x the closing direction, +z the approach.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Array

GRAVITY = 9.81

PAD = (0.0175, 0.0185)
"""Front of a pad: along y and along z [m]."""
PAD_THICKNESS = 0.0152
PAD_CENTER_Z = 0.00025
"""Middle of the pads' fronts along z: 0.0584 + 0.04525 - 0.1034 [m]."""
PAD_STIFFNESS = 1e7 / (PAD_THICKNESS / 2)
"""Pressure over depth: the pads' modulus over half their thickness [N/m^3]."""
OPEN = 0.04
"""Distance of each pad from the middle of the open hand [m]."""


@dataclass(frozen=True)
class Phases:
    """How a trial goes; the hand rises straight up.

    Attributes:
        force: of each finger [N].
        closing_speed: of each finger [m/s].
        stall: force that the servo asks for at rest, over `force`; its gain follows.
        finger_mass: of one finger [kg].
        lift: height [m].
        lift_time: of the whole way up, half of which accelerates and half brakes [s].
        hold_time: [s].
        poll: interval of looks at the contacts [s].
        settled_speed, settled_time: the fingers rest when slower than this for so long [m/s, s].
        close_timeout: [s].
        gap: distance between the pads and what they will touch first, at the start [m].
    """

    force: float = 40.0
    closing_speed: float = 0.05
    stall: float = 1.25
    finger_mass: float = 0.015
    lift: float = 0.30
    lift_time: float = 1.25
    hold_time: float = 0.5
    poll: float = 0.01
    settled_speed: float = 0.002
    settled_time: float = 0.03
    close_timeout: float = 2.0
    gap: float = 0.0005

    @property
    def gain(self) -> float:
        """Of a finger's servo [N s/m]."""
        return self.stall * self.force / self.closing_speed


DEFAULT_PHASES = Phases()


@dataclass(frozen=True)
class HandBox:
    """A box of the hand other than the pads.

    Attributes:
        center: (3,) [m]; with `side`, x counts from the pad's front.
        size: (3,) [m].
        tilt: angle of the box about y [rad].
        side: 1 and -1 for the fingers on the sides of +x and -x, 0 for the palm.
    """

    center: tuple[float, float, float]
    size: tuple[float, float, float]
    tilt: float = 0.0
    side: int = 0

    def local(self, points_G: Array, opening: float) -> Array:
        """(N, 3) points in the axes of the box, from its centre.

        Args:
            points_G: (N, 3).
            opening: distance of each pad from the middle [m].
        """
        x, y, z = points_G.T
        if self.side:
            x = self.side * x - opening
        x, y, z = x - self.center[0], y - self.center[1], z - self.center[2]
        cos, sin = np.cos(self.tilt), np.sin(self.tilt)
        return np.stack((cos * x + sin * z, y, -sin * x + cos * z), axis=1)

    def corners(self, opening: float) -> Array:
        """(8, 3) in G."""
        signs = np.array([(i, j, k) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
        x, y, z = (signs * np.array(self.size) / 2.0).T
        cos, sin = np.cos(self.tilt), np.sin(self.tilt)
        x, z = cos * x - sin * z + self.center[0], sin * x + cos * z + self.center[2]
        if self.side:
            x = self.side * (x + opening)
        return np.stack((x, y + self.center[1], z), axis=1)

    def contains(self, points_G: Array, opening: float, margin: float) -> Array:
        """(N,) whether points (N, 3) are inside, or outside by less than the margin [m]."""
        inside = np.abs(self.local(points_G, opening)) < np.array(self.size) / 2.0 + margin
        return inside.all(axis=1)


PALM = (
    HandBox((0.0, 0.0, 0.0105 - 0.1034), (0.204, 0.051, 0.039)),
    HandBox((0.0, 0.0, 0.0482 - 0.1034), (0.204, 0.0444, 0.0364)),
    HandBox((0.0, 0.0, -0.0005 - 0.1034), (0.184, 0.063, 0.0165)),
)
FINGER_PARTS = tuple(
    box
    for side in (1, -1)
    for box in (
        HandBox((0.0159, 0.0, 0.02835 - 0.045), (0.007, 0.0175, 0.0235), np.pi / 6, side),
        HandBox((0.0185, 0.0, 0.011 - 0.045), (0.015, 0.022, 0.02), 0.0, side),
        HandBox((0.0068, 0.0, 0.0022 - 0.045), (0.0088, 0.022, 0.0038), 0.0, side),
    )
)
PADS = tuple(
    HandBox((PAD_THICKNESS / 2, 0.0, PAD_CENTER_Z), (PAD_THICKNESS, *PAD), 0.0, side)
    for side in (1, -1)
)
