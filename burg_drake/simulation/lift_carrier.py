"""The floating hand's carrier: one vertical joint whose speed is commanded."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from pydrake.multibody.tree import BodyIndex

from burg_drake.simulation.contacts import Contact, reached

if TYPE_CHECKING:
    from burg_drake.simulation.hand_trial import HandTrial


class LiftCarrier:
    """Raises the floating hand; see `Carrier`.

    Args:
        trial: a trial that has been brought to its start, with the hand at the grasp.
        target: the grasped body.
    """

    approach_looks = approach_steps = 0
    tracking_error = tracking_distance = math.nan
    touched = ""

    def __init__(self, trial: HandTrial, target: BodyIndex) -> None:
        settings = trial.settings
        self._trial = trial
        self._target = target
        self._plant = trial.diagram.plant
        self._plant_context = self._plant.GetMyContextFromRoot(trial.context)
        self._names = trial.diagram.body_names
        self._hand = set(trial.diagram.robot_bodies)
        self.lift_height = settings.lift_height
        self.lift_time = settings.lift_time
        self.lift_looks = 2 * max(1, round(settings.lift_time / settings.poll / 2))
        self._top_speed = 2 * settings.lift_height / (self.lift_looks * settings.poll)

    def approach(self) -> None:
        """The hand stands at the grasp."""

    def close(self) -> None:
        """The fingers have been closing from the start."""

    def lift(self, look: int) -> None:
        """Commands the speed of the middle of the interval."""
        looks = self.lift_looks
        speed = self._top_speed * (1 - abs(2 * look + 1 - looks) / looks)
        self._trial.command("lift", np.array([0.0, speed]))

    def stop(self) -> None:
        """Stands still."""
        self._trial.command("lift", np.zeros(2))

    def advance_to(self, time: float) -> None:
        """Steps; commands change only from look to look."""
        self._trial.simulator.AdvanceTo(time)

    def watch(self, contacts: list[Contact]) -> str:
        """Looks for fixed bodies that the hand touches; the table is none of them."""
        hit = reached(contacts, self._hand, self._trial.diagram.fixed.values())
        return self._names[min(hit)] if hit else ""

    def risen(self) -> float:
        """Position of the joint [m]."""
        return self._trial.hand.risen(self._plant_context)

    def bears_the_most(self, look: int) -> bool:
        """The hand accelerates upwards in the first half of the lift."""
        return look < self.lift_looks // 2

    def is_free_above(self) -> bool:
        """Looks along the joint's axis."""
        positions = self._plant.GetPositions(self._plant_context)
        rise = self._trial.rise(self._target)
        return rise.is_free(self._trial.X_WG_start, positions, self.lift_height - self.risen())
