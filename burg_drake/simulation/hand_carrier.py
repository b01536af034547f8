"""The carrier of the floating hand, and checks that the rest of a lift is free."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence, Set as AbstractSet
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import CollisionFilterDeclaration, GeometryId, GeometrySet, QueryObject
from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context

from burg_drake.core import Array, inverse
from burg_drake.simulation.contacts import (
    BodyContact,
    RobotContactWatch,
    touched_bodies,
)
from burg_drake.simulation.settings import TrialSettings
from burg_drake.simulation.swept_boxes import BoxSet, SweptBoxes
from burg_drake.simulation.trial_execution import HandSegment, SteppedWorld
from burg_drake.simulation.trial_world import TrialWorld
from burg_drake.station import (
    ROBOT_MODELS,
    FloatingHand,
    MountedHand,
    StationDiagram,
    collision_geometries,
    replace_meshes_by_pieces,
)


class PlacedRobot(Protocol):
    """Current state of a world of any engine."""

    @property
    def free(self) -> Mapping[str, BodyIndex]:
        """Bodies that can move, by name."""
        ...

    def X_WB(self, body: BodyIndex) -> Array:
        """Pose (4, 4) of a body in the world."""
        ...

    def robot_positions(self, model: str) -> Array | None:
        """Positions of one of `ROBOT_MODELS`, in the order of a station diagram; None if
        missing."""
        ...


MIN_BOX_GAP = 0.002
"""Metres. Smallest distance between separate boxes."""
GeometryBox = tuple[GeometryId, tuple[Array, Array]]
"""A collision geometry, and pose (4, 4) and half size (3,) of its bounding box."""


class _LiftClearance:
    """A Context in which a robot with one target in its hand is checked for collisions.

    Convex pieces replace the meshes of objects. Bodies that move with the hand meet all other
    bodies, but not each other.

    Args:
        station_diagram: a diagram without contact parts.
        instance: name of the target.
        links: bodies of the arm without the hand.
    """

    def __init__(
        self, station_diagram: StationDiagram, instance: str, links: AbstractSet[BodyIndex]
    ) -> None:
        target = station_diagram.free[instance]
        self._diagram, self._plant = station_diagram, station_diagram.plant
        self._context = station_diagram.diagram.CreateDefaultContext()
        self._plant_context = self._plant.GetMyMutableContextFromRoot(self._context)
        replace_meshes_by_pieces(station_diagram, self._context)
        carried = {target, *station_diagram.robot_bodies} - links
        others = {station_diagram.table, *station_diagram.free.values()}
        others |= set(station_diagram.fixed.values())
        self._carried = collision_geometries(self._plant, carried)
        self._others = collision_geometries(self._plant, others - {target})
        manager = station_diagram.scene_graph.collision_filter_manager(
            station_diagram.scene_graph.GetMyMutableContextFromRoot(self._context)
        )
        for side in (self._carried, self._others):
            manager.Apply(CollisionFilterDeclaration().ExcludeWithin(GeometrySet(side)))

    def _query(self) -> QueryObject:
        graph = self._diagram.scene_graph
        return graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(self._context))


class HandLiftClearance(_LiftClearance):
    """Checks the straight path ahead of the hand and one target in it for collisions.

    Args:
        station_diagram: a diagram built with `robot="hand"`, without contact parts.
        instance: name of the target.
    """

    def __init__(self, station_diagram: StationDiagram, instance: str) -> None:
        super().__init__(station_diagram, instance, frozenset())
        self._hand = FloatingHand(station_diagram)
        self._carried_boxes = self._boxes(self._carried)
        self._other_boxes = self._boxes(self._others)
        self._index = station_diagram.free[instance]
        target = self._plant.get_body(self._index)
        self._swept = self._swept_boxes()
        start = target.floating_positions_start() + 4
        self._translations = [start, start + 1, start + 2, self._hand.lift.position_start()]
        others = set(station_diagram.free.values()) - {self._index}
        begins = sorted(self._plant.get_body(i).floating_positions_start() for i in others)
        self._other_positions = [k for begin in begins for k in range(begin, begin + 7)]
        self._other_bounds: tuple[bytes, tuple[Array, Array]] | None = None

    def is_free(self, world: PlacedRobot, X_WG: Array, length: float, direction_W: Array) -> bool:
        """Whether the path is free of collisions.

        Args:
            world: the world in its present state.
            X_WG: (4, 4) grasp at which the path began; it sets the frames of the lift.
            length: remaining length of the path [m].
            direction_W: (3,) unit vector of the lift.
        """
        # Metres between checks. A hand and what it meets are thicker, taken together.
        spacing = 0.01
        self._hand.place(self._plant_context, X_WG, direction_W=direction_W)
        _copy_state(self._diagram, self._plant_context, world)
        positions = self._plant.GetPositions(self._plant_context)
        first, last = self._near_others(length * direction_W)
        travels = np.append(np.arange(spacing, length, spacing), length)
        for travelled in travels[(travels >= first * length) & (travels <= last * length)]:
            moved = positions.copy()
            moved[self._translations] += travelled * np.append(direction_W, 1.0)
            self._plant.SetPositions(self._plant_context, moved)
            if self._query().HasCollisions():
                return False
        return True

    def clearly_free(self, X_WG: Array, X_WO: Array, p_W: Array) -> NDArray[np.bool_]:
        """Whether paths are free as their swept bounding boxes meet nothing, for many at once.

        Others stand where the document places them. Fingers count at all positions. Where boxes
        meet, `is_free` looks closer.

        Args:
            X_WG: (N, 4, 4) grasp frame in the world.
            X_WO: (N, 4, 4) target in the world.
            p_W: (N, 3) rest of the path [m].
        """
        return self._swept.are_apart(X_WG, X_WO, p_W, MIN_BOX_GAP)

    def _swept_boxes(self) -> SweptBoxes:
        """Boxes of the open and of the closed hand, of the target and of all others."""
        boxes, target = self._carried_boxes, set(collision_geometries(self._plant, {self._index}))
        of_hand, ends = [box for box in boxes if box[0] not in target], []
        for closed in (0.0, 1.0):
            self._hand.place(self._plant_context, np.eye(4), closed)
            query = self._query()
            poses = [query.GetPoseInWorld(g).GetAsMatrix4() @ X_PB for g, (X_PB, _) in of_hand]
            ends.append(np.array(poses))
        # Around both ends of the way of each part, which does not turn.
        X_GB, way_G = ends[0].copy(), ends[1][:, :3, 3] - ends[0][:, :3, 3]
        X_GB[:, :3, 3] += way_G / 2.0
        way_B = np.einsum("kji,kj->ki", X_GB[:, :3, :3], way_G)
        half = np.array([size for _, (_, size) in of_hand]) + np.abs(way_B) / 2.0
        inspector, of_target = query.inspector(), [box for box in boxes if box[0] in target]
        X_OB = [inspector.GetPoseInFrame(g).GetAsMatrix4() @ X_PB for g, (X_PB, _) in of_target]
        return SweptBoxes(
            BoxSet(X_GB, half),
            BoxSet(np.array(X_OB), np.array([size for _, (_, size) in of_target])),
            self._placed_boxes(self._other_boxes),
        )

    def _placed_boxes(self, boxes: list[GeometryBox]) -> BoxSet:
        """Boxes of geometries in the world."""
        query = self._query()
        poses = [query.GetPoseInWorld(g).GetAsMatrix4() @ X_PB for g, (X_PB, _) in boxes]
        return BoxSet(np.array(poses), np.array([half for _, (_, half) in boxes]))

    def _near_others(self, p_W: Array) -> tuple[float, float]:
        """Part of a displacement (3,), from 0 to 1, outside which the world-aligned bounding boxes
        of the moving geometries are apart from those of all others; (inf, -inf) if always."""
        low, high = self._bounds(self._carried_boxes)
        q = self._plant.GetPositions(self._plant_context)[self._other_positions].tobytes()
        if self._other_bounds is None or self._other_bounds[0] != q:  # they have moved
            self._other_bounds = q, self._bounds(self._other_boxes)
        other_low, other_high = self._other_bounds[1]
        p_W = np.where(np.abs(p_W) < 1e-12, 1e-12, p_W)  # Divides by it; far below the gap.
        enter = (other_low[None] - MIN_BOX_GAP - high[:, None]) / p_W
        leave = (other_high[None] + MIN_BOX_GAP - low[:, None]) / p_W
        first = np.minimum(enter, leave).max(axis=2).clip(min=0.0)
        last = np.maximum(enter, leave).min(axis=2).clip(max=1.0)
        near = first <= last
        begin, end = first.min(where=near, initial=np.inf), last.max(where=near, initial=-np.inf)
        return float(begin), float(end)

    def _bounds(self, boxes: list[GeometryBox]) -> tuple[Array, Array]:
        """Lower and upper corners (M, 3) of world-aligned bounding boxes of geometries."""
        low, high = self._placed_boxes(boxes).bounds(np.eye(4)[None])
        return low[0], high[0]

    def _boxes(self, geometries: list[GeometryId]) -> list[GeometryBox]:
        inspector = self._query().inspector()
        found = []
        for geometry in geometries:
            box = inspector.GetObbInGeometryFrame(geometry)
            assert box is not None  # only half spaces have no box
            found.append((geometry, (box.pose().GetAsMatrix4(), np.asarray(box.half_width()))))
        return found


class ArmLiftClearance(_LiftClearance):
    """Checks the lift of one target in the hand of an arm for collisions.

    Args:
        station_diagram: a diagram built with `robot="arm"`, without contact parts.
        instance: name of the target.
    """

    def __init__(self, station_diagram: StationDiagram, instance: str) -> None:
        self._hand = MountedHand(station_diagram)
        super().__init__(station_diagram, instance, self._hand.links)
        self._target = self._plant.get_body(station_diagram.free[instance])

    def is_free(self, world: PlacedRobot, q: Array) -> bool:
        """Whether the path is free of collisions.

        Args:
            world: the world in its present state.
            q: (K, n) arm positions along the path.
        """
        context = self._plant_context
        _copy_state(self._diagram, context, world)
        X_WO = self._plant.EvalBodyPoseInWorld(context, self._target).GetAsMatrix4()
        X_HO = inverse(self._hand.X_WH(context)) @ X_WO
        for row in q:
            self._hand.set_arm(context, row)
            X_WO = self._hand.X_WH(context) @ X_HO
            self._plant.SetFloatingBaseBodyPoseInWorldFrame(
                context, self._target, RigidTransform(X_WO)
            )
            if self._query().HasCollisions():
                return False
        return True


def _copy_state(diagram: StationDiagram, plant_context: Context, world: PlacedRobot) -> None:
    """Copies the state of the robot and the movable objects from a world."""
    plant = diagram.plant
    for model in ROBOT_MODELS:
        q = world.robot_positions(model)
        if q is not None:
            plant.SetPositions(plant_context, plant.GetModelInstanceByName(model), q)
    copy_object_poses(diagram, plant_context, world)


def copy_object_poses(diagram: StationDiagram, plant_context: Context, world: PlacedRobot) -> None:
    """Copies the poses of the movable objects from a world; objects that cannot move there stand
    where the document places them."""
    for name, index in diagram.free.items():
        moved = world.free.get(name)
        X_WO = diagram.X_WO(name) if moved is None else world.X_WB(moved)
        body = diagram.plant.get_body(index)
        diagram.plant.SetFloatingBaseBodyPoseInWorldFrame(plant_context, body, RigidTransform(X_WO))


class LiftPath(NamedTuple):
    """A straight segment of the hand's path.

    Attributes:
        direction_W: (3,) unit vector in the world.
        length: [m].
    """

    direction_W: Array
    length: float


W = TypeVar("W", bound=SteppedWorld)


class FloatingCarrier(ABC, Generic[W]):
    """Base of the floating hand's carriers in any engine: segments and obstacle checks; see
    `Carrier`.

    Args:
        world: world of a trial, prepared for its start: the floating hand is at the grasp, or at
            the start of its approach, with the lift joint along the first path.
        paths: straight paths of the hand from the grasp on, at least one.
        lift_clearance: makes the check of the path ahead with the target in the hand.
        approach: the path to the grasp; None if the hand starts there.
        target: the body to be grasped, which the hand may touch once it is at the grasp.
    """

    tracking_error = tracking_distance = math.nan

    def __init__(
        self,
        world: W,
        paths: Sequence[LiftPath],
        lift_clearance: Callable[[], HandLiftClearance],
        approach: LiftPath | None,
        target: BodyIndex,
    ) -> None:
        settings = world.settings
        self._world = world
        self._lift_clearance = lift_clearance
        self._hand = set(world.robot)
        self.segments = tuple(
            HandSegment(*path, check_count(path.length, settings) + (k < len(paths)))
            for k, path in enumerate(paths, start=1)
        )
        self.lift_time = sum(settings.time_of(path.length) for path in paths)
        self._approach = approach
        self.approach_steps = max(1, round(settings.poll / world.engine.time_step))
        self.approach_checks = 0
        self._touches: RobotContactWatch | None = None
        if approach is not None:
            # In one more interval, before it closes, the hand comes to rest.
            self.approach_checks = check_count(approach.length, settings) + 1
            self._touches = RobotContactWatch(world, (), target)
        self._segment_index = 0 if approach is None else -1
        self._is_approaching = self._is_lifting = False
        self._X_WG_start = world.X_WG()

    @property
    def touched(self) -> str:
        """The first unplanned contact; "" without an approach."""
        return "" if self._touches is None else self._touches.first

    def watch(self, contacts: list[BodyContact]) -> str:
        """Finds a fixed body that the hand touches. The table counts only if the hand moves down
        with the target, or presses on the table on its approach."""
        if self._touches is not None:
            stop = self._touches.update(contacts, arrived=not self._is_approaching)
            if self._is_approaching:
                return stop
        fixed = set(self._world.fixed.values()) - {self._world.table}
        if self._is_lifting and self.segments[self._segment_index].direction_W[2] < -1e-6:
            fixed.add(self._world.table)
        hit = touched_bodies(contacts, self._hand, fixed)
        return self._world.body_names[min(hit)] if hit else ""

    @abstractmethod
    def travelled(self) -> float:
        """Position of the joint [m]."""

    def carries_full_load(self, check: int) -> bool:
        """Whether the grip has already carried the largest load of the last segment by interval
        `check`.

        The hand accelerates in the first half of a segment and brakes in the second. Straight up,
        accelerating adds to the weight and braking reduces the load. Otherwise both load the grip.
        """
        settings, last = self._world.settings, self.segments[-1]
        half = check_count(last.length, settings) // 2
        if last.is_straight_up:
            return check < half
        return check >= half + settings.steady_polls

    def is_free_ahead(self) -> bool:
        """Checks the rest of the path along the lift joint's axis."""
        last = self.segments[-1]
        return self._lift_clearance().is_free(
            self._world, self._X_WG_start, last.length - self.travelled(), last.direction_W
        )

    def _begin_segment(self, segment_index: int) -> bool:
        """Makes a segment the current one. Returns whether it changed."""
        self._is_lifting = True
        if segment_index == self._segment_index:
            return False
        self._segment_index, self._X_WG_start = segment_index, self._world.X_WG()
        return True


class LiftCarrier(FloatingCarrier[TrialWorld]):
    """Moves the floating hand to the grasp, if an approach is given, and away from it; see
    `Carrier`.

    Between two segments the hand comes to rest, and its lift joint is aligned with the new
    direction.

    Args:
        world, paths, lift_clearance, approach, target: see `FloatingCarrier`.
    """

    @property
    def _floating(self) -> FloatingHand:
        assert isinstance(self._world.hand, FloatingHand)
        return self._world.hand

    def approach(self) -> None:
        """Starts the approach; the speed is commanded at every contact check."""
        self._is_approaching = True

    def close(self) -> None:
        """Closes the fingers; without an approach they have been closing from the start."""
        if self._approach is not None:
            self._is_approaching = False
            self._world.command("lift", np.zeros(2))
            self._world.command("hand", self._floating.closing_command())

    def lift(self, segment_index: int, check: int) -> None:
        """Commands the mean speed of the interval. Before another segment, the hand comes to rest
        in one more interval."""
        segment = self.segments[segment_index]
        if self._begin_segment(segment_index):
            self._floating.set_lift_direction(self._world.plant_context, segment.direction_W)
            self._world.simulator.Initialize()
        self._command_speed(segment.length, check, self._world.settings.poll)

    def stop(self) -> None:
        """Commands zero speed."""
        self._world.command("lift", np.zeros(2))

    def advance_to(self, time: float) -> None:
        """Advances the simulation; commands change only at contact checks."""
        if self._is_approaching and self._approach is not None:
            interval = self.approach_steps * self._world.engine.time_step
            check = round(self._world.context.get_time() / interval)
            self._command_speed(self._approach.length, check, interval)
        self._world.simulator.AdvanceTo(time)

    def travelled(self) -> float:
        """Position of the joint [m]."""
        return self._floating.travelled(self._world.plant_context)

    def _command_speed(self, length: float, check: int, interval: float) -> None:
        """Commands the mean speed of an interval [s] of a path with a length [m]."""
        checks = check_count(length, self._world.settings)
        top_speed = 2 * length / (checks * interval)
        speed = top_speed * max(0.0, 1 - abs(2 * check + 1 - checks) / checks)
        self._world.command("lift", np.array([0.0, speed]))


def check_count(length: float, settings: TrialSettings) -> int:
    """Number of contact checks on a path with a length [m]; even, for acceleration and braking."""
    return 2 * max(1, round(settings.time_of(length) / settings.poll / 2))
