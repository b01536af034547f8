"""Collision checks of arm configurations in a scene, by Drake's `SceneGraphCollisionChecker`.

Bodies that do not move are tied to the world. An instance that the hand carries is shifted.

Geometry of bodies that are welded to the world is given to the world itself, as Drake updates the
geometry of every body at each configuration; this halves the time of a check.

Drake's checker demands exact interpolation, so a carried object has no revolute joints. It stands
on a vertical prismatic joint, and the frame of that joint moves in the other two directions.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import ArrayLike
from pydrake.common import Parallelism
from pydrake.geometry import (
    CollisionFilterDeclaration,
    GeometryId,
    GeometryInstance,
    GeometrySet,
    ProximityProperties,
    Role,
    SceneGraphInspector,
)
from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex, FixedOffsetFrame
from pydrake.planning import CollisionCheckerContext, RobotDiagram, SceneGraphCollisionChecker
from pydrake.systems.framework import Context

from burg_drake.core import Array, InvalidInputError, UnknownNameError, suggest_names
from burg_drake.station import PLACEMENT_FRAME_NAME, VERTICAL_JOINT_NAME, StationDiagram


def anchor_geometry(
    checker: SceneGraphCollisionChecker,
    station_diagram: StationDiagram,
    bodies: Collection[BodyIndex],
) -> dict[GeometryId, BodyIndex]:
    """Gives the collision geometry of bodies to the world, where they are by default.

    Args:
        checker: all its contexts are changed; its filter matrix must not be set afterwards.
        station_diagram: what it checks; it stays as it is.
        bodies: what does not move, and does not overlap robot links that do not move either: those
            the world does not collide with.

    Returns:
        The body that each of the world's new geometries belongs to.
    """
    plant, graph = station_diagram.plant, station_diagram.scene_graph
    plant_context = plant.CreateDefaultContext()
    inspector, source = graph.model_inspector(), plant.get_source_id()
    filtered = checker.GetFilteredCollisionMatrix()[int(plant.world_body().index())]
    never = [  # of fixed links, and of what is carried, which counts against links alone
        geometry
        for i in range(plant.num_bodies())
        if filtered[i] and BodyIndex(i) not in bodies
        for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(BodyIndex(i)))
    ]
    body_of: dict[GeometryId, BodyIndex] = {}

    def anchor(_: RobotDiagram, context: CollisionCheckerContext) -> None:
        for body in bodies:
            anchor_body(body, context.scene_graph_context())

    def anchor_body(body: BodyIndex, graph_context: Context) -> None:
        X_WB = plant.EvalBodyPoseInWorld(plant_context, plant.get_body(body))
        anchored = []
        for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(body)):
            X_WP, shape = X_WB @ inspector.GetPoseInFrame(geometry), inspector.GetShape(geometry)
            instance = GeometryInstance(X_WP, shape, f"anchored_{geometry.get_value()}")
            instance.set_proximity_properties(ProximityProperties())
            graph.RemoveRole(graph_context, source, geometry, Role.kProximity)
            world = inspector.world_frame_id()
            anchored.append(graph.RegisterGeometry(graph_context, source, world, instance))
        body_of.update(dict.fromkeys(anchored, body))
        declaration = CollisionFilterDeclaration()
        declaration.ExcludeBetween(GeometrySet(anchored), GeometrySet(never))
        graph.collision_filter_manager(graph_context).Apply(declaration)

    checker.PerformOperationAgainstAllModelContexts(anchor)
    return body_of


def release_geometry(
    checker: SceneGraphCollisionChecker,
    station_diagram: StationDiagram,
    body: BodyIndex,
    anchored: Mapping[GeometryId, BodyIndex],
    ignored: Collection[BodyIndex],
) -> None:
    """Takes the collision geometry of a body back from the world, so that the body moves again.

    Args:
        checker: all its contexts are changed, in which `anchor_geometry` has been at work.
        station_diagram: what it checks; it stays as it is.
        body: the body.
        anchored: what `anchor_geometry` has returned.
        ignored: bodies that it does not collide with.
    """
    plant, graph = station_diagram.plant, station_diagram.scene_graph
    inspector, source = graph.model_inspector(), plant.get_source_id()
    own = plant.GetCollisionGeometriesForBody(plant.get_body(body))
    free = {*ignored} - {*anchored.values()}
    others = {g for b in free for g in plant.GetCollisionGeometriesForBody(plant.get_body(b))}
    others |= {geometry for geometry, of in anchored.items() if of in ignored}
    tied = {geometry for geometry, of in anchored.items() if of == body}

    def release(_: RobotDiagram, context: CollisionCheckerContext) -> None:
        graph_context = context.scene_graph_context()
        known = {*context.GetQueryObject().inspector().GetAllGeometryIds()}  # each has its own
        for geometry in tied & known:
            graph.RemoveRole(graph_context, source, geometry, Role.kProximity)
        for geometry in own if tied else ():
            properties = inspector.GetProximityProperties(geometry)
            graph.AssignRole(graph_context, source, geometry, properties)
        declaration = CollisionFilterDeclaration()
        declaration.ExcludeWithin(GeometrySet(own))
        declaration.ExcludeBetween(GeometrySet(own), GeometrySet([*(others & known)]))
        graph.collision_filter_manager(graph_context).Apply(declaration)

    checker.PerformOperationAgainstAllModelContexts(release)


class CarriedInstances:
    """Moves the free instances of a diagram that was built with `weld_objects=True`; there are none
    where they are free bodies."""

    def __init__(self, station_diagram: StationDiagram) -> None:
        plant = station_diagram.plant
        self._height: dict[str, int] = {}
        self._place: dict[str, FixedOffsetFrame] = {}
        for name, body in station_diagram.free.items():
            model = plant.get_body(body).model_instance()
            if plant.HasJointNamed(VERTICAL_JOINT_NAME, model):
                joint = plant.GetJointByName(VERTICAL_JOINT_NAME, model)
                self._height[name] = joint.position_start()
                self._place[name] = cast(
                    FixedOffsetFrame, plant.GetFrameByName(PLACEMENT_FRAME_NAME, model)
                )

    def height(self, name: str) -> int:
        """Where in the plant's positions an instance's height over its place is.

        Raises:
            UnknownNameError: there is no such instance.
        """
        if name not in self._height:
            known = tuple(self._height)
            raise UnknownNameError(
                f"{name!r} is not an instance that can be carried; {suggest_names(name, known)}"
            )
        return self._height[name]

    def shifted(self, checker: SceneGraphCollisionChecker) -> InstanceShifts:
        """Shifts in a checker of the diagram, where all stand at their places."""
        return InstanceShifts(checker, self._place)


class InstanceShifts:
    """How far instances stand beside their places in one checker."""

    def __init__(
        self, checker: SceneGraphCollisionChecker, place: dict[str, FixedOffsetFrame]
    ) -> None:
        self._checker, self._place = checker, place
        self._moved: tuple[str, Array] | None = None

    def put(self, name: str, p_W: ArrayLike) -> None:
        """Shifts one instance, and puts all others at their places.

        Args:
            name: the instance; "" for none.
            p_W: (2,) along x and y of the world [m].
        """
        p = np.asarray(p_W, dtype=float)
        before = self._moved
        if before is not None and (before[0] != name or not np.array_equal(before[1], p)):
            self._set(before[0], np.zeros(2))
            self._moved = before = None
        if before is None and p.any():
            self._set(name, p)
            self._moved = name, p

    def _set(self, name: str, p: Array) -> None:
        place = self._place[name]
        X_WO = place.GetFixedPoseInBodyFrame()  # as the diagram was built
        moved = RigidTransform(X_WO.rotation(), X_WO.translation() + np.append(p, 0.0))

        def shift(_: RobotDiagram, context: CollisionCheckerContext) -> None:
            place.SetPoseInParentFrame(context.plant_context(), moved)

        self._checker.PerformOperationAgainstAllModelContexts(shift)


NO_DISPLACEMENT = (0.0, 0.0, 0.0)
"""Metres. Displacement of a target that is where the document places it."""


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
            those of the whole plant, fingers included. Clones of it answer here, see
            `anchor_geometry`.
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
        with _silence_checker_log():
            self.checker = SceneGraphCollisionChecker(
                model=station_diagram.diagram,
                robot_model_instances=[plant.GetModelInstanceByName(n) for n in ("arm", "hand")],
                edge_step_size=0.05,  # radians
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
        self._carried = CarriedInstances(station_diagram)
        self._carrying: dict[str, tuple[SceneGraphCollisionChecker, InstanceShifts]] = {}
        self._anchored: dict[GeometryId, BodyIndex] = {}
        self._in_base = self._overlapping_base()
        self._in_hand = set(plant.GetBodyIndices(hand))
        body = plant.GetBodyByName(station_diagram.station.hand.body, hand)
        fingers = self._in_hand - {body.index()}  # which may be asked about closed, too
        self._apart = tuple(pair for pair in apart if not fingers & {*pair})
        self._empty_handed = self._answering()
        self._shifts = self._carried.shifted(self.checker)
        self._names = station_diagram.body_names
        self._with_hand = _hand_bodies(station_diagram)

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
                positions[index] = finger.position(closed)
        if carried:
            positions[self._carried.height(carried)] = rise
        return positions

    def is_free(
        self,
        q: Array,
        *,
        carried: str | None = None,
        moved_W: ArrayLike = NO_DISPLACEMENT,
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
        moved = _check_displacement(carried, moved_W)
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
        moved_W: ArrayLike = NO_DISPLACEMENT,
        width: float = np.nan,
    ) -> list[Overlap]:
        """What collides, the deepest overlap first; empty if free. See `is_free`.

        It is seldom asked with something carried, and needs no clone for it.
        """
        moved = _check_displacement(carried, moved_W)
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
        self._shifts.put("", NO_DISPLACEMENT[:2])
        found = [self._overlap(a, b, depth) for (a, b), depth in depths.items()]
        return sorted(found, key=lambda o: (-o.depth, str(o)))

    def _checker(self, carried: str) -> tuple[SceneGraphCollisionChecker, InstanceShifts]:
        """The checker's clone that answers; what is carried is not held against the hand."""
        if carried not in self._carrying:
            checker = self._releasing(self._diagram.free[carried])
            self._carrying[carried] = checker, self._carried.shifted(checker)
        return self._carrying[carried]

    def _answering(self) -> SceneGraphCollisionChecker:
        """A clone of the checker, with all tied to the world that does not move in it."""
        ignored_pair = 1  # A pair that is not checked, in Drake's filter matrix.
        diagram, checker = self._diagram, self.checker.Clone()
        filtered = checker.GetFilteredCollisionMatrix().copy()  # set once: that costs 1 ms
        for a, b in self._apart:
            filtered[int(a), int(b)] = filtered[int(b), int(a)] = ignored_pair
        checker.SetCollisionFilterMatrix(filtered)
        still = {*diagram.free.values(), *diagram.fixed.values(), diagram.table}
        self._anchored |= anchor_geometry(checker, diagram, still - self._in_base)
        return checker

    def _releasing(self, held: BodyIndex) -> SceneGraphCollisionChecker:
        """A clone of that one in which a body moves, and is not held against the hand."""
        checker = self._empty_handed.Clone()
        filtered = checker.GetFilteredCollisionMatrix()[int(held)] != 0
        ignored = {BodyIndex(int(k)) for k in np.flatnonzero(filtered)} | self._in_hand
        release_geometry(checker, self._diagram, held, self._anchored, ignored - {held})
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
def _silence_checker_log() -> Iterator[None]:
    """Keeps the checker from logging how many contexts it makes."""
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        yield
    finally:
        logger.setLevel(level)


def _check_displacement(carried: str | None, moved_W: ArrayLike) -> Array:
    moved = np.asarray(moved_W, dtype=float)
    if not carried and moved.any():
        raise InvalidInputError(
            f"moved_W is {moved.tolist()} m, but no instance is carried; give `carried`"
        )
    return moved


def _hand_bodies(station_diagram: StationDiagram) -> frozenset[BodyIndex]:
    """Hand, fingers and the links that are welded to the hand."""
    plant = station_diagram.plant
    hand = plant.GetModelInstanceByName("hand")
    body = plant.GetBodyByName(station_diagram.station.hand.body, hand)
    welded = {b.index() for b in plant.GetBodiesWeldedTo(body)}
    return frozenset(welded | set(plant.GetBodyIndices(hand)))
