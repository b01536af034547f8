"""Motions during a trial: of objects from where they stood, and of the target in the hand."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from typing import Protocol

import numpy as np
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array, inverse, rotation_angle
from burg_drake.simulation.settings import TrialSettings


class PlacedBodies(Protocol):
    """What a tracker has to know of a world."""

    def X_WB(self, body: BodyIndex) -> Array:
        """(4, 4) of a body."""
        ...

    def center(self, body: BodyIndex) -> Array:
        """Centre of mass (3,) of a body in the world [m]."""
        ...

    def corners(self, body: BodyIndex) -> Array:
        """(N, 3) corners of a body's convex hull in its frame [m]."""
        ...


class MotionTracker:
    """Watches bodies: the point of each that has moved farthest, how far it has turned, and how its
    centre of mass moves.

    Args:
        world: with the bodies where they stand. No point of a body moves farther than the corner
            of its hull that moves farthest.
        bodies: which to watch.

    Attributes:
        farthest: largest displacement of each body's farthest point since the start [m].
        turned: largest rotation of each body since the start [rad].
    """

    def __init__(self, world: PlacedBodies, bodies: Iterable[BodyIndex]) -> None:
        self._world = world
        self._start = {index: self._pose(index) for index in bodies}
        self._last = {index: self._world.center(index) for index in self._start}
        self._height = {index: self._own_height(index) for index in self._start}
        self._overturned: set[BodyIndex] = set()
        self.farthest = dict.fromkeys(self._start, 0.0)
        self.turned = dict.fromkeys(self._start, 0.0)

    def update(self, still: Collection[BodyIndex]) -> float:
        """Measures; those in `still` are at rest.

        Returns:
            The largest motion of a centre of mass since the last look [m].
        """
        largest = 0.0
        for index in self._start.keys() - still:
            moved, angle = self._since_start(index)
            self.farthest[index] = max(self.farthest[index], moved)
            self.turned[index] = max(self.turned[index], angle)
            if self._is_tilted(index) and self._is_higher_or_lower(index):
                self._overturned.add(index)
            center = self._world.center(index)
            largest = max(largest, float(np.linalg.norm(center - self._last[index])))
            self._last[index] = center
        return largest

    def toppled(self, bodies: Mapping[str, BodyIndex]) -> list[str]:
        """Names of those of the bodies that are tilted now, and went over an edge on the way or
        rest at another height. What rolls does neither: a ball, or a can that lies."""
        return [
            name
            for name, index in bodies.items()
            if index in self._overturned and self._is_tilted(index)
        ]

    def _is_tilted(self, index: BodyIndex) -> bool:
        """Whether the axis that was upright no longer is."""
        cosine = self._pose(index)[0][2] @ self._start[index][0][2]
        return bool(cosine < math.cos(math.radians(45.0)))

    def _is_higher_or_lower(self, index: BodyIndex) -> bool:
        """Whether the centre of mass is at another height above the body's lowest point."""
        min_height_change = 0.003  # Metres. What rolls keeps the height of its centre of mass.
        min_height_share = 0.1  # Share of the height.
        before = self._height[index]
        return abs(self._own_height(index) - before) > max(
            min_height_change, min_height_share * before
        )

    def _own_height(self, index: BodyIndex) -> float:
        """Of the centre of mass above the body's lowest point [m]; what is below does not count."""
        R_WB, p_WB = self._pose(index)
        lowest = (self._world.corners(index) @ R_WB[2]).min() + p_WB[2]
        return float(self._world.center(index)[2] - lowest)

    def _since_start(self, index: BodyIndex) -> tuple[float, float]:
        """How far the farthest point of a body is from where it was [m], and its rotation [rad].

        The way of a point is linear in its place on the body, and its length convex: no point
        within the hull has gone farther than every corner.
        """
        (R_WB, p_WB), (R_WB_start, p_WB_start) = self._pose(index), self._start[index]
        p_PP_W = self._world.corners(index) @ (R_WB - R_WB_start).T + (p_WB - p_WB_start)
        farthest = math.sqrt((p_PP_W * p_PP_W).sum(axis=1).max())
        return farthest, float(rotation_angle(R_WB @ R_WB_start.T))

    def _pose(self, index: BodyIndex) -> tuple[Array, Array]:
        """Rotation (3, 3) and position (3,) of a body in the world [m]."""
        X_WB = self._world.X_WB(index)
        return X_WB[:3, :3], X_WB[:3, 3]


SLIP_LEVER = 0.01
"""Metres. Rotation in the hand counts as the motion of a point this far from the grasp."""


class GripMotion:
    """Follows one target in the hand.

    Args:
        settings: phases of the trial.
        X_GO: (4, 4) target in the grasp frame at the start.
    """

    def __init__(self, settings: TrialSettings, X_GO: Array) -> None:
        self._settings = settings
        self._X_GO_last = X_GO
        self._X_GO_grip: Array | None = None
        self._motions: list[float] = []

    def grip(self) -> None:
        """Both fingers hold the target, as it was at the last look."""
        self._X_GO_grip = self._X_GO_last

    def record(self, X_GO: Array, *, others_rest: bool) -> None:
        """Takes down where the target is.

        Args:
            X_GO: (4, 4) target in the grasp frame.
            others_rest: whether all other objects are at rest; if not, what was before tells
                nothing any more of what is to come.
        """
        distance, angle = motion_in_hand(self._X_GO_last, X_GO)
        self._X_GO_last = X_GO
        if others_rest:
            self._motions.append(max(distance, angle * SLIP_LEVER))
        else:
            self._motions.clear()

    def reset(self) -> None:
        """From now on only later looks tell what is to come."""
        self._motions.clear()

    @property
    def since_grip(self) -> tuple[float, float]:
        """Slip [m] and tilt [rad]; NaN if both fingers never held the target."""
        if self._X_GO_grip is None:
            return math.nan, math.nan
        return motion_in_hand(self._X_GO_grip, self._X_GO_last)

    @property
    def is_beyond_limits(self) -> bool:
        """Whether the target has turned or slid so far that it does not count as lifted."""
        slip, tilt = self.since_grip
        return slip > self._settings.slip_limit or tilt > self._settings.tilt_limit

    @property
    def is_steady(self) -> bool:
        """Whether the target has stuck to the pads for `steady_time`."""
        settings = self._settings
        recent = self._motions[-settings.steady_polls :]
        enough = len(recent) == settings.steady_polls
        return enough and max(recent) <= settings.creep_speed * settings.poll

    def is_coming_to_rest(self, time: float) -> bool:
        """Whether the target moves in the hand no faster than before, and not far any more.

        Drake's friction is slightly viscous: below its limit a load does not slide but creeps, at a
        constant speed that is the higher, the larger the time step.

        Args:
            time: that is left at most [s].
        """
        n = self._settings.steady_polls
        before, now = sum(self._motions[-2 * n : -n]), sum(self._motions[-n:])
        if len(self._motions) < 2 * n or now > before:
            return False
        return self._further_creep(time) <= self._settings.creep_distance

    def is_verdict_stable(self, time: float) -> bool:
        """Whether the target is beyond the limits for good, or will not come there, whatever creep
        still adds.

        Args:
            time: that is left at most [s].
        """
        settings, creep = self._settings, self._further_creep(time)
        slip, tilt = self.since_grip
        slid = creep * (1.0 + slip / SLIP_LEVER)  # turning moves what has slid by its distance
        turned = creep / SLIP_LEVER
        if slip - slid > settings.slip_limit or tilt - turned > settings.tilt_limit:
            return True
        max_tilt = min(math.pi, tilt + turned)
        return slip + slid <= settings.slip_limit and max_tilt <= settings.tilt_limit

    def _further_creep(self, time: float) -> float:
        """How far the target gets in a time [s] if it goes on as during the last looks [m]."""
        recent = self._motions[-self._settings.steady_polls :]
        return sum(recent) / len(recent) * (time / self._settings.poll)


def motion_in_hand(X_GO: Array, X_GO_later: Array) -> tuple[float, float]:
    """How a target has moved in the hand: of the point at the grasp [m], and its angle [rad]."""
    X_GG = X_GO_later @ inverse(X_GO)
    return float(np.linalg.norm(X_GG[:3, 3])), float(rotation_angle(X_GG[:3, :3]))
