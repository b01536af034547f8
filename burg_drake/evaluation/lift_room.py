"""How far the hand alone can lift, where a motion allows less than the whole lift."""

from __future__ import annotations

import numpy as np

from burg_drake.core import Array
from burg_drake.motion import HandSweep, lift_heights
from burg_drake.scene import Scene
from burg_drake.station import GraspMotion, Station


class LiftRoom:
    """Looks for the room of lifts in a scene, by what the hand sweeps: geometry, no arm, no steps.

    Args:
        scene: what stands there.
        station: whose hand it is.
        motion: of the hand.
    """

    def __init__(self, scene: Scene, station: Station, motion: GraspMotion) -> None:
        self._sweep = HandSweep(scene, station, motion)
        self._heights = lift_heights(motion.shortest, motion.lift_height)

    def length(self, instance: str, X_WG: Array, width: Array) -> Array:
        """(N,) lengths of lifts on which the hand meets nothing, with the target in it [m].

        The least one that is allowed is given where even that one is not free: the trial tells what
        comes of it.

        Args:
            instance: the target.
            X_WG: (N, 4, 4) grasps in the world.
            width: (N,) distance between the pads [m]; NaN where the hand is open.
        """
        low = np.zeros(len(X_WG), dtype=int)
        high = np.full(len(X_WG), len(self._heights))
        level = high - 1  # most often there is room for all of it
        while (high - low > 1).any():
            for k in np.unique(level[high - low > 1]):
                rows = np.flatnonzero((level == k) & (high - low > 1))
                sweep = self._sweep.lift(instance, X_WG[rows], width[rows], self._heights[k])
                low[rows[sweep.free]], high[rows[~sweep.free]] = k, k
            level = (low + high) // 2
        return np.asarray(self._heights[low])
