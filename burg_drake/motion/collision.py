"""Collision checks of arm configurations in a scene, by Drake's `SceneGraphCollisionChecker`."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from pydrake.common import Parallelism
from pydrake.multibody.tree import BodyIndex
from pydrake.planning import SceneGraphCollisionChecker

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array
from burg_drake.station.diagram import StationDiagram

EDGE_STEP = 0.05
"""Distance between the checked configurations of an edge [rad]."""


@dataclass(frozen=True)
class Overlap:
    """Two bodies that penetrate each other.

    Attributes:
        link: the robot's link.
        other: instance, obstacle, `table`, or another link.
        depth: of the deepest contact [m].
        carried: `link` is rigid with the hand and `other` is not of the arm, so that every
            configuration with the hand at this pose has the same overlap.
    """

    link: str
    other: str
    depth: float
    carried: bool

    def __str__(self) -> str:
        return f"{self.link} vs {self.other}"


class ArmCollision:
    """Checks the arm, its hand open, against itself and the scene as the documents place it.

    Attributes:
        checker: Drake's checker. Configurations are those of the whole plant, fingers included.
        joints: the arm's joints from base to hand.
    """

    def __init__(self, station_diagram: StationDiagram) -> None:
        """Takes a diagram over; nobody else may use its plant for something else.

        Args:
            station_diagram: built with `robot="arm"` and `weld_objects=True`: Drake's checker
                demands that interpolation between two equal configurations is exact, which
                quaternions of free bodies may miss by a rounding.

        Raises:
            InvalidInputError: the diagram has no arm.
        """
        if station_diagram.robot != "arm":
            raise InvalidInputError(
                f"the diagram was built with robot={station_diagram.robot!r}; build it with 'arm'"
            )
        plant = station_diagram.plant
        self._diagram = station_diagram
        with _without_remarks():
            self.checker = SceneGraphCollisionChecker(
                model=station_diagram.diagram,
                robot_model_instances=[plant.GetModelInstanceByName(n) for n in ("arm", "hand")],
                edge_step_size=EDGE_STEP,
                implicit_context_parallelism=Parallelism(1),
            )
        self.joints = station_diagram.arm_joints
        self._index = [joint.position_start() for joint in self.joints]
        self._default = plant.GetPositions(plant.CreateDefaultContext())
        self._names = station_diagram.body_names
        self._carried = _carried(station_diagram)

    def configuration(self, q: Array) -> Array:
        """The whole plant's positions for arm positions `q` (n,)."""
        positions = self._default.copy()
        positions[self._index] = q
        return positions

    def is_free(self, q: Array) -> bool:
        """Drake's verdict on arm positions `q` (n,)."""
        return bool(self.checker.CheckConfigCollisionFree(self.configuration(q)))

    def overlaps(self, q: Array) -> list[Overlap]:
        """What collides at arm positions `q` (n,), the deepest overlap first; empty if free."""
        self.checker.UpdatePositions(self.configuration(q))
        query = self.checker.model_context().GetQueryObject()  # with the checker's filters
        depths: dict[tuple[BodyIndex, BodyIndex], float] = {}
        for pair in query.ComputePointPairPenetration():
            inspector = query.inspector()
            a, b = (
                self._diagram.plant.GetBodyFromFrameId(inspector.GetFrameId(g)).index()
                for g in (pair.id_A, pair.id_B)
            )
            depths[a, b] = max(depths.get((a, b), 0.0), pair.depth)
        found = [self._overlap(a, b, depth) for (a, b), depth in depths.items()]
        return sorted(found, key=lambda o: (-o.depth, str(o)))

    def _overlap(self, a: BodyIndex, b: BodyIndex, depth: float) -> Overlap:
        robot = self._diagram.robot_bodies
        if a not in robot or (b in robot and b > a):
            a, b = b, a
        carried = a in self._carried and b not in robot
        return Overlap(self._names[a], self._names[b], depth, carried)


@contextmanager
def _without_remarks() -> Iterator[None]:
    """Keeps the checker from logging how many contexts it makes."""
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        yield
    finally:
        logger.setLevel(level)


def _carried(station_diagram: StationDiagram) -> frozenset[BodyIndex]:
    """Hand, fingers and the links that are welded to the hand."""
    plant = station_diagram.plant
    hand = plant.GetModelInstanceByName("hand")
    body = plant.GetBodyByName(station_diagram.station.hand.body, hand)
    welded = {b.index() for b in plant.GetBodiesWeldedTo(body)}
    return frozenset(welded | set(plant.GetBodyIndices(hand)))
