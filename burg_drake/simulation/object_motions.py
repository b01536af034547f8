"""Motions during a trial: of objects from where they stood, and of the target in the hand."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array, inverse, rotation_angle
from burg_drake.simulation.settings import TrialSettings


class PlacedBodies(Protocol):
    """Poses and shapes of bodies, as a motion tracker needs them."""

    def X_WB(self, body: BodyIndex) -> Array:
        """Pose (4, 4) of a body in the world."""
        ...

    def center(self, body: BodyIndex) -> Array:
        """Centre of mass (3,) of a body in the world [m]."""
        ...

    def corners(self, body: BodyIndex) -> Array:
        """(N, 3) corners of a body's convex hull in its frame [m]."""
        ...


@dataclass(frozen=True, eq=False)
class MovingBody:
    """A rigid body in motion, in the world frame.

    Attributes:
        mass: [kg].
        I_W: (3, 3) rotational inertia about the centre of mass [kg m^2].
        p_W: (3,) centre of mass [m].
        v_W: (3,) its velocity [m/s].
        w_W: (3,) angular velocity [rad/s].
    """

    mass: float
    I_W: Array
    p_W: Array
    v_W: Array
    w_W: Array


def carried_past(w_W: Array, p_W: Array, time_step: float, steps: int) -> Array:
    """How far time steps carry a turning body past a point about which it turns.

    A step moves the origin of a body straight on by its velocity, and turns the body about it. Of a
    body that turns about another point at p from its origin, that point is moved along, by
    `h^2 / 2 w x (w x p)` in a step h: the second term of the rotation. A long object that swings
    in the grip would creep out of it by centimetres in a second, the more the longer the step and
    the farther its origin.

    Args:
        w_W: (3,) angular velocity [rad/s].
        p_W: (3,) the point, from the body's origin [m].
        time_step: h [s].
        steps: number of steps.

    Returns:
        (3,) the displacement of the point [m], in the axes of the others.
    """
    return 0.5 * time_step**2 * steps * np.cross(w_W, np.cross(w_W, p_W))


class MotionTracker:
    """Tracks bodies: the displacement of the farthest-moved point, the rotation, and the motion of
    the centre of mass.

    Args:
        world: a world with the bodies at their start. A body's farthest-moved point is a corner of
            its convex hull.
        bodies: bodies to track.

    Attributes:
        farthest: largest displacement of each body's farthest point since the start [m].
        turned: largest rotation of each body since the start [rad].
    """

    def __init__(self, world: PlacedBodies, bodies: Iterable[BodyIndex]) -> None:
        self._world = world
        self._start = {index: self._pose(index) for index in bodies}
        self._last = {index: self._world.center(index) for index in self._start}
        self._height = {index: self._center_height(index) for index in self._start}
        self._overturned: set[BodyIndex] = set()
        self.farthest = dict.fromkeys(self._start, 0.0)
        self.turned = dict.fromkeys(self._start, 0.0)

    def update(self, still: Collection[BodyIndex]) -> float:
        """Measures all bodies, except those in `still`, which are at rest.

        Returns:
            The largest motion of a centre of mass since the last update [m].
        """
        largest = 0.0
        for index in self._start.keys() - still:
            moved, angle = self._motion_since_start(index)
            self.farthest[index] = max(self.farthest[index], moved)
            self.turned[index] = max(self.turned[index], angle)
            if self._is_tilted(index) and self._is_higher_or_lower(index):
                self._overturned.add(index)
            center = self._world.center(index)
            largest = max(largest, float(np.linalg.norm(center - self._last[index])))
            self._last[index] = center
        return largest

    def toppled(self, bodies: Mapping[str, BodyIndex]) -> list[str]:
        """Names of toppled bodies: they are tilted, and went over an edge or rest at another
        height. Rolling bodies, such as a ball or a lying can, do neither."""
        return [
            name
            for name, index in bodies.items()
            if index in self._overturned and self._is_tilted(index)
        ]

    def _is_tilted(self, index: BodyIndex) -> bool:
        """Whether the axis that was vertical at the start no longer is."""
        cosine = self._pose(index)[0][2] @ self._start[index][0][2]
        return bool(cosine < math.cos(math.radians(45.0)))

    def _is_higher_or_lower(self, index: BodyIndex) -> bool:
        """Whether the height of the centre of mass above the body's lowest point has changed."""
        min_height_change = 0.003  # Metres. A rolling body keeps the height of its centre of mass.
        min_height_share = 0.1  # Share of the height.
        before = self._height[index]
        return abs(self._center_height(index) - before) > max(
            min_height_change, min_height_share * before
        )

    def _center_height(self, index: BodyIndex) -> float:
        """Height of the centre of mass above the body's lowest point [m], whatever lies below
        it."""
        R_WB, p_WB = self._pose(index)
        lowest = (self._world.corners(index) @ R_WB[2]).min() + p_WB[2]
        return float(self._world.center(index)[2] - lowest)

    def _motion_since_start(self, index: BodyIndex) -> tuple[float, float]:
        """Displacement of a body's farthest-moved point [m], and its rotation [rad], since the
        start.

        The displacement is linear in the point, and its norm convex, so its largest value is at a
        corner of the hull.
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
    """Tracks the motion of one target in the hand.

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
        """Marks the target's last recorded pose as the start of the grip."""
        self._X_GO_grip = self._X_GO_last

    def record(self, X_GO: Array, *, others_rest: bool) -> None:
        """Records the target's pose.

        Args:
            X_GO: (4, 4) target in the grasp frame.
            others_rest: whether all other objects are at rest; if not, earlier records are no
                longer used for predictions.
        """
        distance, angle = motion_in_hand(self._X_GO_last, X_GO)
        self._X_GO_last = X_GO
        if others_rest:
            self._motions.append(max(distance, angle * SLIP_LEVER))
        else:
            self._motions.clear()

    def reset(self) -> None:
        """Discards earlier records for predictions."""
        self._motions.clear()

    @property
    def since_grip(self) -> tuple[float, float]:
        """Slip [m] and tilt [rad] since the grip; NaN if both fingers never held the target."""
        if self._X_GO_grip is None:
            return math.nan, math.nan
        return motion_in_hand(self._X_GO_grip, self._X_GO_last)

    @property
    def is_beyond_limits(self) -> bool:
        """Whether tilt or slip exceeds the limits for a lifted target."""
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
        """Whether the target moves in the hand no faster than before, and will not creep far.

        Drake's friction is slightly viscous: below its limit a load does not slide but creeps, at a
        constant speed that grows with the time step.

        Args:
            time: longest remaining time [s].
        """
        n = self._settings.steady_polls
        before, now = sum(self._motions[-2 * n : -n]), sum(self._motions[-n:])
        if len(self._motions) < 2 * n or now > before:
            return False
        return self._further_creep(time) <= self._settings.creep_distance

    def is_verdict_stable(self, time: float) -> bool:
        """Whether further creep cannot change if tilt and slip are within the limits.

        Args:
            time: longest remaining time [s].
        """
        settings, creep = self._settings, self._further_creep(time)
        slip, tilt = self.since_grip
        slid = creep * (1.0 + slip / SLIP_LEVER)  # turning also moves a slid target
        turned = creep / SLIP_LEVER
        if slip - slid > settings.slip_limit or tilt - turned > settings.tilt_limit:
            return True
        max_tilt = min(math.pi, tilt + turned)
        return slip + slid <= settings.slip_limit and max_tilt <= settings.tilt_limit

    def _further_creep(self, time: float) -> float:
        """Motion of the target in a time [s], extrapolated from the last records [m]."""
        recent = self._motions[-self._settings.steady_polls :]
        return sum(recent) / len(recent) * (time / self._settings.poll)


def motion_in_hand(X_GO: Array, X_GO_later: Array) -> tuple[float, float]:
    """Motion of a target in the hand: of its point at the grasp [m], and its rotation angle
    [rad]."""
    X_GG = X_GO_later @ inverse(X_GO)
    return float(np.linalg.norm(X_GG[:3, 3])), float(rotation_angle(X_GG[:3, :3]))
