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
    """Attaches the collision geometry of bodies to the world, at their default poses.

    Args:
        checker: all its contexts are changed; its filter matrix must not be set afterwards.
        station_diagram: the diagram that it checks; it is not changed.
        bodies: bodies that do not move, without those that overlap fixed robot links: the world
            does not collide with fixed links.

    Returns:
        The body that each of the world's new geometries belongs to.
    """
    plant, graph = station_diagram.plant, station_diagram.scene_graph
    plant_context = plant.CreateDefaultContext()
    inspector, source = graph.model_inspector(), plant.get_source_id()
    filtered = checker.GetFilteredCollisionMatrix()[int(plant.world_body().index())]
    never = [  # geometry of fixed links and of the carried instance, which counts against links
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
    """Detaches the collision geometry of a body from the world, so that the body moves again.

    Args:
        checker: all its contexts are changed; `anchor_geometry` has been applied to them.
        station_diagram: the diagram that it checks; it is not changed.
        body: the body to release.
        anchored: the result of `anchor_geometry`.
        ignored: bodies that the released body does not collide with.
    """
    plant, graph = station_diagram.plant, station_diagram.scene_graph
    inspector, source = graph.model_inspector(), plant.get_source_id()
    own = plant.GetCollisionGeometriesForBody(plant.get_body(body))
    free = {*ignored} - {*anchored.values()}
    others = {g for b in free for g in plant.GetCollisionGeometriesForBody(plant.get_body(b))}
    others |= {geometry for geometry, owner in anchored.items() if owner in ignored}
    tied = {geometry for geometry, owner in anchored.items() if owner == body}

    def release(_: RobotDiagram, context: CollisionCheckerContext) -> None:
        graph_context = context.scene_graph_context()
        known = {*context.GetQueryObject().inspector().GetAllGeometryIds()}  # differs by context
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
    """Moves the free instances of a diagram built with `weld_objects=True`. It has no instances if
    the diagram has free bodies."""

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

    def height_index(self, name: str) -> int:
        """Index of an instance's height above its placement in the plant's positions.

        Raises:
            UnknownNameError: there is no such instance.
        """
        if name not in self._height:
            known = tuple(self._height)
            raise UnknownNameError(
                f"{name!r} is not an instance that can be carried; {suggest_names(name, known)}"
            )
        return self._height[name]

    def shifts_for(self, checker: SceneGraphCollisionChecker) -> InstanceShifts:
        """Shifts for a checker of the diagram in which all instances are at their placements."""
        return InstanceShifts(checker, self._place)


class InstanceShifts:
    """Horizontal displacement of the instances in one checker."""

    def __init__(
        self, checker: SceneGraphCollisionChecker, place: dict[str, FixedOffsetFrame]
    ) -> None:
        self._checker, self._place = checker, place
        self._moved: tuple[str, Array] | None = None

    def shift_only(self, name: str, p_W: ArrayLike) -> None:
        """Shifts one instance, and moves all others back to their placements.

        Args:
            name: the instance; "" for none.
            p_W: (2,) displacement along x and y of the world [m].
        """
        p = np.asarray(p_W, dtype=float)
        before = self._moved
        if before is not None and (before[0] != name or not np.array_equal(before[1], p)):
            self._move_placement(before[0], np.zeros(2))
            self._moved = before = None
        if before is None and p.any():
            self._move_placement(name, p)
            self._moved = name, p

    def _move_placement(self, name: str, p: Array) -> None:
        place = self._place[name]
        X_WO = place.GetFixedPoseInBodyFrame()  # as the diagram was built
        moved = RigidTransform(X_WO.rotation(), X_WO.translation() + np.append(p, 0.0))

        def shift(_: RobotDiagram, context: CollisionCheckerContext) -> None:
            place.SetPoseInParentFrame(context.plant_context(), moved)

        self._checker.PerformOperationAgainstAllModelContexts(shift)


NO_DISPLACEMENT = (0.0, 0.0, 0.0)
"""Metres. Displacement of a target that stands where the document places it."""


@dataclass(frozen=True)
class Overlap:
    """Two bodies that penetrate each other.

    Attributes:
        link: the robot's link.
        other: instance, obstacle, `table`, or another link.
        depth: depth of the deepest contact [m].
        carried: whether `link` is rigid with the hand and `other` is not part of the arm, so that
            every configuration with the hand at this pose has the same overlap.
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
        checker: Drake's checker of the unchanged diagram, for other uses. Its configurations are
            those of the whole plant, fingers included. The checks here use clones of it, see
            `anchor_geometry`.
        joints: the arm's joints from base to hand.
    """

    def __init__(
        self, station_diagram: StationDiagram, *, apart: Sequence[tuple[BodyIndex, BodyIndex]] = ()
    ) -> None:
        """Takes over a diagram; its plant must not be used elsewhere.

        Args:
            station_diagram: built with `robot="arm"` and `weld_objects=True`: Drake's checker
                demands that interpolation between two equal configurations is exact, which
                quaternions of free bodies may miss by a rounding.
            apart: pairs of bodies that cannot meet in any configuration to be checked. Leaving them
                out saves 40 of 110 us of a check with the Panda.

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
        self._instances = CarriedInstances(station_diagram)
        self._carrying_checkers: dict[str, tuple[SceneGraphCollisionChecker, InstanceShifts]] = {}
        self._anchored: dict[GeometryId, BodyIndex] = {}
        self._base_obstacles = self._find_base_obstacles()
        self._in_hand = set(plant.GetBodyIndices(hand))
        body = plant.GetBodyByName(station_diagram.station.hand.body, hand)
        fingers = self._in_hand - {body.index()}  # checked with closed fingers, too
        self._apart = tuple(pair for pair in apart if not fingers & {*pair})
        self._empty_handed = self._make_anchored_checker()
        self._shifts = self._instances.shifts_for(self.checker)
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
            rise: its height above its placement [m].
            width: distance between the pads [m]; NaN if the hand is open.

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
            positions[self._instances.height_index(carried)] = rise
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
            carried: the instance that the hand holds; None or "" if the hand is empty. The instance
                is an obstacle to the arm's links, but not to the hand and its fingers. Collisions
                between objects are not checked.
            moved_W: (3,) displacement of that instance [m]; all others are at their placements.
            width: distance between the pads [m]; NaN if the hand is open.

        Raises:
            UnknownNameError: there is no such instance.
            InvalidInputError: `moved_W` is not zero, but nothing is carried.
        """
        moved = _check_displacement(carried, moved_W)
        configuration = self.configuration(q, carried, moved[2], width)
        if not carried:
            return bool(self._empty_handed.CheckConfigCollisionFree(configuration))
        checker, shifts = self._carrying_checker(carried)
        shifts.shift_only(carried, moved[:2])
        return bool(checker.CheckConfigCollisionFree(configuration))

    def overlaps(
        self,
        q: Array,
        *,
        carried: str | None = None,
        moved_W: ArrayLike = NO_DISPLACEMENT,
        width: float = np.nan,
    ) -> list[Overlap]:
        """Overlaps, the deepest first; empty if free. See `is_free`.

        Calls with a carried instance are rare, so that they use no clone of the checker.
        """
        moved = _check_displacement(carried, moved_W)
        configuration = self.configuration(q, carried, moved[2], width)
        held = self._diagram.free[carried] if carried else None
        checker = self.checker if carried else self._empty_handed
        self._shifts.shift_only(carried or "", moved[:2])
        checker.UpdatePositions(configuration)
        query = checker.model_context().GetQueryObject()  # with the checker's filters
        depths: dict[tuple[BodyIndex, BodyIndex], float] = {}
        for pair in query.ComputePointPairPenetration():
            a, b = (self._body(query.inspector(), g) for g in (pair.id_A, pair.id_B))
            if held in (a, b) and self._in_hand & {a, b}:
                continue
            depths[a, b] = max(depths.get((a, b), 0.0), pair.depth)
        self._shifts.shift_only("", NO_DISPLACEMENT[:2])
        found = [self._overlap(a, b, depth) for (a, b), depth in depths.items()]
        return sorted(found, key=lambda o: (-o.depth, str(o)))

    def _carrying_checker(self, carried: str) -> tuple[SceneGraphCollisionChecker, InstanceShifts]:
        """Clone of the checker for a carried instance, which does not collide with the hand."""
        if carried not in self._carrying_checkers:
            checker = self._make_carrying_checker(self._diagram.free[carried])
            self._carrying_checkers[carried] = checker, self._instances.shifts_for(checker)
        return self._carrying_checkers[carried]

    def _make_anchored_checker(self) -> SceneGraphCollisionChecker:
        """Clone of the checker in which all fixed geometry is attached to the world."""
        ignored_pair = 1  # A pair that is not checked, in Drake's filter matrix.
        diagram, checker = self._diagram, self.checker.Clone()
        filtered = checker.GetFilteredCollisionMatrix().copy()  # set once, as setting costs 1 ms
        for a, b in self._apart:
            filtered[int(a), int(b)] = filtered[int(b), int(a)] = ignored_pair
        checker.SetCollisionFilterMatrix(filtered)
        still = {*diagram.free.values(), *diagram.fixed.values(), diagram.table}
        self._anchored |= anchor_geometry(checker, diagram, still - self._base_obstacles)
        return checker

    def _make_carrying_checker(self, held: BodyIndex) -> SceneGraphCollisionChecker:
        """Clone of the empty-handed checker in which a body moves and ignores the hand."""
        checker = self._empty_handed.Clone()
        filtered = checker.GetFilteredCollisionMatrix()[int(held)] != 0
        ignored = {BodyIndex(int(k)) for k in np.flatnonzero(filtered)} | self._in_hand
        release_geometry(checker, self._diagram, held, self._anchored, ignored - {held})
        return checker

    def _find_base_obstacles(self) -> set[BodyIndex]:
        """Objects that overlap fixed robot links."""
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
