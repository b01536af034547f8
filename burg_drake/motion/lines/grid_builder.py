"""Postures of a Panda along the straight parts of grasps' motions: where they are looked for, and
how near they are to collisions."""

from __future__ import annotations

import numpy as np

from burg_drake.core import Array, Booleans, Indices
from burg_drake.motion.ik import ArmKinematics, PandaIk
from burg_drake.motion.lines.line_poses import LinePoses
from burg_drake.motion.lines.posture_grid import PostureGrid
from burg_drake.motion.lines.reach_settings import ReachSettings
from burg_drake.motion.proximity import LIKELY, ArmProximity, ClearanceBounds

CHANGE = 0.75
"""Most that the redundant joint may change from layer to layer [rad] ..."""
CROSSING = 0.38
"""... and where the branch changes."""
OFFSETS = (1, 2, 4, 8, 16, 24)
"""By how many of its values the redundant joint may change: large changes need no fine choice."""
START = 0.3
"""Cost of a start for each radian of the joint that is farthest from home."""


class PostureGridBuilder:
    """Opens grids of postures.

    Args:
        arm: the arm on its own.
        ik: the inverse kinematics, within the limits that are to be kept.
        lines: where the hand goes.
        proximity: bounds of the arm's clearance.
        home: (7,) home posture; chains that start near it are preferred [rad].
        settings: how thoroughly to look.
    """

    def __init__(
        self,
        arm: ArmKinematics,
        ik: PandaIk,
        lines: LinePoses,
        proximity: ArmProximity,
        home: Array,
        settings: ReachSettings,
    ) -> None:
        self.arm, self.ik, self.lines, self.proximity = arm, ik, lines, proximity
        self.home, self.settings = home, settings
        self.layers, self.at_grasp = lines.layers, lines.at_grasp

    def parameters(self, count: int) -> Array:
        """(count,) values of the redundant joint within its limits [rad]."""
        low, high = self.ik.lower[-1], self.ik.upper[-1]
        return np.asarray(low + (np.arange(count) + 0.5) / count * (high - low))

    def grid(self, X_AG: Array, count: int) -> PostureGrid:
        """Room for the postures of grasps (n, 2, 4, 4)."""
        X_AH = self.lines.X_AH(X_AG[None], self.layers[:, None, None])
        values = self.parameters(count)
        spacing = values[1] - values[0] if count > 1 else np.inf
        return PostureGrid(
            *(self.ik, X_AH, values),
            travel=self.settings.joint_travel,
            offsets=_offsets(CHANGE / spacing),
            crossing=_offsets(CROSSING / spacing),
        )

    def measure(self, grid: PostureGrid, poses: Indices, grasps: Indices, wanted: Booleans) -> None:
        """Measures the wanted postures at some poses of some grasps that have not been measured."""
        if not len(grasps):
            return
        where = np.ix_(poses, grasps)
        new = wanted[where] & np.isinf(grid.lower[where])
        if not new.any():
            return
        q = np.stack([joint[where][new] for joint in grid.q], axis=-1)
        bounds = self.proximity.bounds(q, hand=False)
        lower, upper = grid.lower[where], grid.upper[where]
        lower[new], upper[new] = bounds.lower, counted_clearance(bounds, self.settings.exact)
        grid.lower[where], grid.upper[where] = lower, upper


def _offsets(most: float) -> tuple[int, ...]:
    """Those of `OFFSETS`, up and down, that are no larger, and 0; rising."""
    up = [k for k in OFFSETS if k <= most]
    return (*(-k for k in reversed(up)), 0, *up)


def counted_clearance(bounds: ClearanceBounds, exact: bool) -> Array:
    """What has to be positive for a posture to count (K,): the upper bound where Drake has the last
    word; otherwise infinite where it is the best guess, too."""
    if exact:
        return bounds.upper
    return np.where(bounds.likely_free, np.inf, np.minimum(bounds.upper, LIKELY))
