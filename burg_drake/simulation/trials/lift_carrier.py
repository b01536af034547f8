"""The floating hand's carrier: one joint along the way, whose speed is commanded."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from burg_drake.core import Array
from burg_drake.simulation.trials.carrier import HandSegment
from burg_drake.simulation.trials.contacts import BodyContact, reached
from burg_drake.simulation.trials.lift_clearance import HandLiftClearance
from burg_drake.simulation.trials.trial_settings import TrialSettings
from burg_drake.simulation.trials.trial_world import TrialWorld
from burg_drake.station.diagram import FloatingHand

DOWN = -1e-6
"""Upward part of a direction (unit vector) that goes down by more than rounding."""


class LiftPath(NamedTuple):
    """A straight segment of the hand's path.

    Attributes:
        direction_W: (3,) unit vector in the world.
        length: [m].
    """

    direction_W: Array
    length: float


class LiftCarrier:
    """Takes the floating hand away from the grasp; see `Carrier`.

    Where one segment ends and the next begins, the hand comes to rest, and its joint is laid along
    the new direction.

    Args:
        world: that of a trial which has been brought to its start, with the floating hand at the
            grasp and the joint along the first of the paths.
        paths: of the hand, straight, at least one.
        lift_clearance: gives the check of the path ahead with the target in the hand.
    """

    approach_checks = approach_steps = 0
    tracking_error = tracking_distance = math.nan
    touched = ""

    def __init__(
        self,
        world: TrialWorld,
        paths: Sequence[LiftPath],
        lift_clearance: Callable[[], HandLiftClearance],
    ) -> None:
        assert isinstance(world.hand, FloatingHand)
        settings = world.settings
        self._world = world
        self._floating = world.hand
        self._lift_clearance = lift_clearance
        self._plant = world.diagram.plant
        self._plant_context = self._plant.GetMyMutableContextFromRoot(world.context)
        self._names = world.diagram.body_names
        self._hand = set(world.diagram.robot_bodies)
        self.segments = tuple(
            HandSegment(*path, _check_count(path.length, settings) + (number + 1 < len(paths)))
            for number, path in enumerate(paths)
        )
        self.lift_time = sum(settings.time_of(path.length) for path in paths)
        self._number = 0
        self._is_lifting = False
        self._X_WG_start = self._floating.X_WG(self._plant_context)

    def approach(self) -> None:
        """The hand stands at the grasp."""

    def close(self) -> None:
        """The fingers have been closing from the start."""

    def lift(self, number: int, check: int) -> None:
        """Commands the speed of the middle of the interval; in one interval more, where another
        segment follows, the hand comes to rest."""
        segment, settings = self.segments[number], self._world.settings
        self._is_lifting = True
        if number != self._number:
            self._number = number
            self._X_WG_start = self._floating.X_WG(self._plant_context)
            self._floating.set_lift_direction(self._plant_context, segment.direction_W)
            self._world.simulator.Initialize()
        checks = _check_count(segment.length, settings)
        top_speed = 2 * segment.length / (checks * settings.poll)
        speed = top_speed * max(0.0, 1 - abs(2 * check + 1 - checks) / checks)
        self._world.command("lift", np.array([0.0, speed]))

    def stop(self) -> None:
        """Stands still."""
        self._world.command("lift", np.zeros(2))

    def advance_to(self, time: float) -> None:
        """Steps; commands change only from look to look."""
        self._world.simulator.AdvanceTo(time)

    def watch(self, contacts: list[BodyContact]) -> str:
        """Looks for fixed bodies that the hand touches; the table is none of them, unless the hand
        goes down."""
        fixed = set(self._world.diagram.fixed.values())
        if self._is_lifting and self.segments[self._number].direction_W[2] < DOWN:
            fixed.add(self._world.diagram.table)
        hit = reached(contacts, self._hand, fixed)
        return self._names[min(hit)] if hit else ""

    def travelled(self) -> float:
        """Position of the joint [m]."""
        return self._floating.travelled(self._plant_context)

    def carries_full_load(self, check: int) -> bool:
        """The hand accelerates in the first half of a segment and brakes in the second. Straight
        up, the first adds to the weight and the second takes away from it. Otherwise both count,
        and standing still is in between."""
        half = _check_count(self.segments[-1].length, self._world.settings) // 2
        if self.segments[-1].is_straight_up:
            return check < half
        return check >= half + self._world.settings.steady_polls

    def is_free_ahead(self) -> bool:
        """Looks along the joint's axis."""
        last = self.segments[-1]
        return self._lift_clearance().is_free(
            self._world, self._X_WG_start, last.length - self.travelled(), last.direction_W
        )


def _check_count(length: float, settings: TrialSettings) -> int:
    """Looks on a path of a length [m]: as many to speed up as to brake."""
    return 2 * max(1, round(settings.time_of(length) / settings.poll / 2))
