"""Collision checks of arm configurations in a scene, by Drake's `SceneGraphCollisionChecker`."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from pydrake.common import Parallelism
from pydrake.geometry import GeometryId, SceneGraphInspector
from pydrake.multibody.tree import BodyIndex
from pydrake.planning import SceneGraphCollisionChecker

from burg_drake.core import Array, InvalidInputError
from burg_drake.motion.collision.anchoring import anchor, release
from burg_drake.motion.collision.carried import Carried, Shifts
from burg_drake.station.diagram import StationDiagram

EDGE_STEP = 0.05
"""Distance between the checked configurations of an edge [rad]."""

STILL = (0.0, 0.0, 0.0)

FILTERED = 1
"""A pair that does not collide, in the filter matrix of Drake's `CollisionChecker`."""


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
    """Checks the arm and its hand against itself and the scene as the documents place it.

    Attributes:
        checker: Drake's checker of the diagram as it is, for other questions. Configurations are
            those of the whole plant, fingers included. Clones of it answer here: see `anchoring`.
        joints: the arm's joints from base to hand.
    """

    def __init__(
        self, station_diagram: StationDiagram, *, apart: Sequence[tuple[BodyIndex, BodyIndex]] = ()
    ) -> None:
        """Takes a diagram over; nobody else may use its plant for something else.

        Args:
            station_diagram: built with `robot="arm"` and `weld_objects=True`: Drake's checker
                demands that interpolation between two equal configurations is exact, which
                quaternions of free bodies may miss by a rounding.
            apart: pairs of bodies that are known not to meet wherever the arm may be asked about:
                they are left out, which saves 40 of 110 us of a check with the Panda.

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
        hand = plant.GetModelInstanceByName("hand")
        self._fingers = [
            (plant.GetJointByName(finger.joint, hand).position_start(), finger)
            for finger in station_diagram.station.hand.fingers
        ]
        self._carried = Carried(station_diagram)
        self._carrying: dict[str, tuple[SceneGraphCollisionChecker, Shifts]] = {}
        self._anchored: dict[GeometryId, BodyIndex] = {}
        self._in_base = self._overlapping_base()
        hand = plant.GetModelInstanceByName("hand")
        self._in_hand = set(plant.GetBodyIndices(hand))
        body = plant.GetBodyByName(station_diagram.station.hand.body, hand)
        fingers = self._in_hand - {body.index()}  # which may be asked about closed, too
        self._apart = tuple(pair for pair in apart if not fingers & {*pair})
        self._empty_handed = self._answering()
        self._shifts = self._carried.shifted(self.checker)
        self._names = station_diagram.body_names
        self._with_hand = _with_hand(station_diagram)

    def configuration(
        self,
        q: Array,
        carried: str | None = None,
        rise: float = 0.0,
        width: float = np.nan,
    ) -> Array:
        """The whole plant's positions for arm positions `q` (n,).

        Args:
            q: (n,) arm positions.
            carried: the instance that the hand holds, if any.
            rise: how far that is above its place [m].
            width: distance between the pads [m]; the hand is open if that is NaN.

        Raises:
            UnknownNameError: there is no such instance.
        """
        positions: Array = self._default.copy()
        positions[self._index] = q
        if not np.isnan(width):
            low, high = self._diagram.station.hand.opening
            closed = min(max((high - width) / (high - low), 0.0), 1.0)
            for index, finger in self._fingers:
                positions[index] = finger.open + closed * (finger.closed - finger.open)
        if carried:
            positions[self._carried.height(carried)] = rise
        return positions

    def is_free(
        self,
        q: Array,
        *,
        carried: str | None = None,
        moved_W: ArrayLike = STILL,
        width: float = np.nan,
    ) -> bool:
        """Drake's verdict on arm positions `q` (n,).

        Args:
            q: (n,) arm positions.
            carried: the instance that the hand holds; None or "" if it is empty. It counts as an
                obstacle to the arm's links, but not to the hand and its fingers; against the scene
                no object counts.
            moved_W: (3,) how far that instance is from its place [m]; all others are at theirs.
            width: distance between the pads [m]; the hand is open if that is NaN.

        Raises:
            UnknownNameError: there is no such instance.
            InvalidInputError: nothing is carried, and has been moved.
        """
        moved = _checked(carried, moved_W)
        configuration = self.configuration(q, carried, moved[2], width)
        if not carried:
            return bool(self._empty_handed.CheckConfigCollisionFree(configuration))
        checker, shifts = self._checker(carried)
        shifts.put(carried, moved[:2])
        return bool(checker.CheckConfigCollisionFree(configuration))

    def overlaps(
        self,
        q: Array,
        *,
        carried: str | None = None,
        moved_W: ArrayLike = STILL,
        width: float = np.nan,
    ) -> list[Overlap]:
        """What collides, the deepest overlap first; empty if free. See `is_free`.

        It is seldom asked with something carried, and needs no clone for it.
        """
        moved = _checked(carried, moved_W)
        configuration = self.configuration(q, carried, moved[2], width)
        held = self._diagram.free[carried] if carried else None
        checker = self.checker if carried else self._empty_handed
        self._shifts.put(carried or "", moved[:2])
        checker.UpdatePositions(configuration)
        query = checker.model_context().GetQueryObject()  # with the checker's filters
        depths: dict[tuple[BodyIndex, BodyIndex], float] = {}
        for pair in query.ComputePointPairPenetration():
            a, b = (self._body(query.inspector(), g) for g in (pair.id_A, pair.id_B))
            if held in (a, b) and self._in_hand & {a, b}:
                continue
            depths[a, b] = max(depths.get((a, b), 0.0), pair.depth)
        self._shifts.put("", STILL[:2])
        found = [self._overlap(a, b, depth) for (a, b), depth in depths.items()]
        return sorted(found, key=lambda o: (-o.depth, str(o)))

    def _checker(self, carried: str) -> tuple[SceneGraphCollisionChecker, Shifts]:
        """The checker's clone that answers; what is carried is not held against the hand."""
        if carried not in self._carrying:
            checker = self._releasing(self._diagram.free[carried])
            self._carrying[carried] = checker, self._carried.shifted(checker)
        return self._carrying[carried]

    def _answering(self) -> SceneGraphCollisionChecker:
        """A clone of the checker, with all tied to the world that does not move in it."""
        diagram, checker = self._diagram, self.checker.Clone()
        filtered = checker.GetFilteredCollisionMatrix().copy()  # set once: that costs 1 ms
        for a, b in self._apart:
            filtered[int(a), int(b)] = filtered[int(b), int(a)] = FILTERED
        checker.SetCollisionFilterMatrix(filtered)
        still = {*diagram.free.values(), *diagram.fixed.values(), diagram.table}
        self._anchored |= anchor(checker, diagram, still - self._in_base)
        return checker

    def _releasing(self, held: BodyIndex) -> SceneGraphCollisionChecker:
        """A clone of that one in which a body moves, and is not held against the hand."""
        checker = self._empty_handed.Clone()
        filtered = checker.GetFilteredCollisionMatrix()[int(held)] != 0
        ignored = {BodyIndex(int(k)) for k in np.flatnonzero(filtered)} | self._in_hand
        release(checker, self._diagram, held, self._anchored, ignored - {held})
        return checker

    def _overlapping_base(self) -> set[BodyIndex]:
        """The objects that robot links are in which do not move."""
        plant, robot = self._diagram.plant, set(self._diagram.robot_bodies)
        fixed = {b.index() for b in plant.GetBodiesWeldedTo(plant.world_body())} & robot
        self.checker.UpdatePositions(self._default)
        query = self.checker.model_context().GetQueryObject()
        pairs = [
            {self._body(query.inspector(), geometry) for geometry in (pair.id_A, pair.id_B)}
            for pair in query.ComputePointPairPenetration()
        ]
        return {body for pair in pairs if pair & fixed for body in pair - robot}

    def _body(self, inspector: SceneGraphInspector, geometry: GeometryId) -> BodyIndex:
        if geometry in self._anchored:
            return self._anchored[geometry]
        body = self._diagram.plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        return body.index()

    def _overlap(self, a: BodyIndex, b: BodyIndex, depth: float) -> Overlap:
        robot = self._diagram.robot_bodies
        if a not in robot or (b in robot and b > a):
            a, b = b, a
        carried = a in self._with_hand and b not in robot
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


def _checked(carried: str | None, moved_W: ArrayLike) -> Array:
    moved = np.asarray(moved_W, dtype=float)
    if not carried and moved.any():
        raise InvalidInputError(
            f"moved_W is {moved.tolist()} m, but no instance is carried; give `carried`"
        )
    return moved


def _with_hand(station_diagram: StationDiagram) -> frozenset[BodyIndex]:
    """Hand, fingers and the links that are welded to the hand."""
    plant = station_diagram.plant
    hand = plant.GetModelInstanceByName("hand")
    body = plant.GetBodyByName(station_diagram.station.hand.body, hand)
    welded = {b.index() for b in plant.GetBodiesWeldedTo(body)}
    return frozenset(welded | set(plant.GetBodyIndices(hand)))
