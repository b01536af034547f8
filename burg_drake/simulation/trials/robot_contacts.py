"""What a robot touches that it should not."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Protocol

import numpy as np
from pydrake.multibody.tree import BodyIndex

from burg_drake.simulation.trials.contacts import BodyContact

STOP_FORCE = 20.0
"""Force of the table on the hand at which the robot stops on its way to the grasp [N]: the nominal
threshold of a Panda's reflex in libfranka's examples (`setCollisionBehavior` in
generate_joint_velocity_motion.cpp)."""


class NamedBodies(Protocol):
    """A world with a robot, and what people call its bodies; see `StationDiagram`."""

    @property
    def body_names(self) -> Mapping[BodyIndex, str]: ...
    @property
    def robot_bodies(self) -> Collection[BodyIndex]: ...
    @property
    def free(self) -> Mapping[str, BodyIndex]: ...
    @property
    def table(self) -> BodyIndex: ...


class RobotContactWatch:
    """Watches a robot.

    Args:
        world: with a robot.
        links: the arm's bodies, without the hand's; none of the hand alone.
        target: the body to be grasped.

    Attributes:
        first: the first such touch, "panda_link5 vs can"; "" if there was none.
    """

    def __init__(self, world: NamedBodies, links: Collection[BodyIndex], target: BodyIndex) -> None:
        self._names = world.body_names
        self._robot = frozenset(world.robot_bodies)
        self._links = frozenset(links)
        self._free = frozenset(world.free.values())
        self._table = world.table
        self._planned = (target, world.table)
        self.first = ""

    def update(self, contacts: Collection[BodyContact], arrived: bool) -> str:
        """Takes down the contacts of a look.

        Args:
            contacts: all that there are.
            arrived: whether the hand has come to the grasp, from when on it may touch target and
                table.

        Returns:
            What stops the robot: "panda_link5 vs shelf" of a link that touches something fixed or
            another link, "shelf" of the hand; on the way to the grasp `table`, if the hand presses
            on it with more than `STOP_FORCE`. "" if nothing does.
        """
        stops, on_table = [], np.zeros(3)
        for contact in contacts:
            for one, other, sign in (
                (contact.body_A, contact.body_B, 1.0),
                (contact.body_B, contact.body_A, -1.0),
            ):
                link = one in self._links
                if one not in self._robot or (other in self._robot and not link):
                    continue
                name = f"{self._names[one]} vs {self._names[other]}"
                if link or not arrived or other not in self._planned:
                    self.first = self.first or name
                if link and other not in self._free:
                    stops.append(name)
                elif other == self._table:
                    on_table += sign * contact.f_B_W
                elif other not in self._free:
                    stops.append(self._names[other])
        if not arrived and np.linalg.norm(on_table) > STOP_FORCE:
            stops.append(self._names[self._table])
        return min(stops, default="")
