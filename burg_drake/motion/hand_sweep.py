"""Collision checks of the hand on approach, retreat and lift of many grasps, without the arm.

The swept volume of a convex part along a straight segment is convex (`geometry`), so a segment is
checked as a whole, not at samples. No result depends on the rest of a batch, bit by bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from burg_drake.core import Array, UnknownNameError, check_pose, rng_from, suggest_names
from burg_drake.geometry import (
    Ball,
    Body,
    Cylinder,
    HandScreen,
    Shape,
    rotate,
    swept_body,
    swept_shape,
)
from burg_drake.grasping import filter_hand_pairs, read_shapes, screened_bodies
from burg_drake.motion.target_sweep import PathBlockers, TargetSweep
from burg_drake.scene import Scene
from burg_drake.station import (
    FloatingHand,
    GraspMotion,
    Station,
    StationDiagram,
    build_station_diagram,
)


@dataclass(frozen=True, eq=False)
class HandPart:
    """Shapes of a hand that are rigid to each other.

    Attributes:
        shapes: the shapes, in the grasp frame of the open hand.
        closing_G: (3,) displacement when the open hand closes as far as it can [m]; 0 for the
            hand's body.
        opening: smallest and largest distance between the pads [m].
    """

    shapes: tuple[Shape, ...]
    closing_G: Array
    opening: tuple[float, float]

    def placed(self, X_WG: Array, width: Array) -> Array:
        """Grasp frames of open hands whose part is where this part is at the given widths.

        Args:
            X_WG: (N, 4, 4) grasps.
            width: (N,) distance between the pads [m]; NaN where the hand is open.

        Returns:
            (N, 4, 4) poses in the world.
        """
        low, high = self.opening
        closed = np.clip((high - np.where(np.isnan(width), high, width)) / (high - low), 0.0, 1.0)
        moved = X_WG.copy()
        moved[:, :3, 3] += rotate(X_WG[:, :3, :3], closed[:, None] * self.closing_G)
        return moved


def read_hand_parts(
    station_diagram: StationDiagram,
) -> tuple[tuple[HandPart, ...], dict[str, Body]]:
    """The hand and all bodies that it can collide with.

    Args:
        station_diagram: a diagram built with `robot="hand"`.

    Returns:
        The hand's body and its fingers, without parts that have no shapes; and the other bodies by
        name.

    Raises:
        InvalidInputError: see `read_shapes`.
    """
    hand = FloatingHand(station_diagram)
    plant = station_diagram.plant
    context = station_diagram.diagram.CreateDefaultContext()
    plant_context = plant.GetMyMutableContextFromRoot(context)
    names = screened_bodies(station_diagram)
    body_of = filter_hand_pairs(station_diagram, context, names)
    hand.place(plant_context, np.eye(4))
    graph = station_diagram.scene_graph
    query = graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(context))
    shapes, bodies = read_shapes(station_diagram, plant_context, query, body_of, names)
    inspector, robot = query.inspector(), set(station_diagram.robot_bodies)
    owners = [
        body
        for geometry, body in body_of.items()
        if body in robot and inspector.GetProximityProperties(geometry) is not None
    ]
    links = [
        {body.index() for body in plant.GetBodiesWeldedTo(plant.get_body(finger))}
        for finger in hand.fingers
    ]
    links.insert(0, robot - links[0] - links[1])
    paths = [np.zeros(3), *_closing_paths(hand, plant, plant_context)]
    owned = [
        tuple(s for s, owner in zip(shapes, owners, strict=True) if owner in own) for own in links
    ]
    opening = hand.document.opening
    parts = [HandPart(o, path, opening) for o, path in zip(owned, paths, strict=True) if o]
    return tuple(parts), bodies


def is_hand_symmetric(parts: Sequence[HandPart]) -> bool:
    """Whether a hand occupies the same space after half a turn about its approach axis, by the
    support distances of its shapes in 64 directions."""
    rng = rng_from("burg_drake directions")
    directions = rng.normal(size=(64, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    shapes = [shape for part in parts for shape in part.shapes]
    reach = np.array([_support_distance(shape, directions) for shape in shapes])
    about_z = directions * (-1.0, -1.0, 1.0)
    turned = np.array([_support_distance(shape, about_z) for shape in shapes])
    gap = np.sort(reach, axis=0) - np.sort(turned, axis=0)
    return bool(np.abs(gap).max(initial=0.0) < 1e-9)


def _support_distance(shape: Shape, directions: Array) -> Array:
    """How far a shape reaches along unit vectors (D, 3) from the origin [m]."""
    d_P = directions @ shape.X_BP[:3, :3]
    along = directions @ shape.X_BP[:3, 3]
    if isinstance(shape.convex, (Ball, Cylinder)):
        components = (d_P[:, 0], d_P[:, 1], d_P[:, 2])
        return np.asarray(along + shape.convex.support_distance(components))
    assert shape.polytope is not None  # all others are polytopes
    return np.asarray(along + (d_P @ shape.polytope.vertices.T).max(axis=1))


def _closing_paths(
    hand: FloatingHand, plant: MultibodyPlant, plant_context: Context
) -> list[Array]:
    """Displacement of each finger from open to closed, in the grasp frame (3,) [m]."""
    ends = []
    for closed in (0.0, 1.0):
        hand.place(plant_context, np.eye(4), closed)
        poses = [plant.EvalBodyPoseInWorld(plant_context, plant.get_body(i)) for i in hand.fingers]
        ends.append([X_GF.translation() for X_GF in poses])
    return [np.asarray(end - start) for start, end in zip(*ends, strict=True)]


def deepest_overlap_along_path(
    screen: HandScreen, X_WG: Array, names: NDArray[np.object_], u_W: Array, length: float
) -> tuple[Array, Array]:
    """The deepest overlap of each hand with the body that blocks its path.

    Along the path the depth in a convex piece rises to one maximum and falls. A body of several
    pieces may have several maxima; the one next to the deepest grid point is found.

    Args:
        screen: the hand, not swept.
        X_WG: (N, 4, 4) grasps in the world, at which the paths start.
        names: (N,) names of the blocking bodies.
        u_W: (N, 3) unit vectors along the paths.
        length: length of the paths [m].

    Returns:
        Depths (N,) and their distances from the start (N,) [m]; depth 0 and NaN where the overlap
        is so short that the finest grid misses it.
    """
    steps = (0.02, 0.002)  # Metres. The second step is used where the first finds no overlap.
    depth, at = np.zeros(len(X_WG)), np.full(len(X_WG), np.nan)
    for step in steps:
        left = np.flatnonzero(depth == 0.0)
        places = np.linspace(0.0, length, int(np.ceil(length / step)) + 1)
        s = np.broadcast_to(places, (len(left), len(places)))
        found = _overlap_depths(screen, X_WG[left], names[left], u_W[left], s)
        depth[left], at[left] = found.max(axis=1), places[found.argmax(axis=1)]
    step = steps[0] / 2
    found_any = np.flatnonzero(depth > 0.0)
    # The place of the deepest overlap is found to within 0.5 mm.
    while step > 0.5e-3 and len(found_any):
        i = found_any
        s = np.clip(at[i, None] + np.array((-step, step)), 0.0, length)
        found = _overlap_depths(screen, X_WG[i], names[i], u_W[i], s)
        best, row = found.argmax(axis=1), np.arange(len(i))
        better = found[row, best] > depth[i]
        depth[i] = np.where(better, found[row, best], depth[i])
        at[i] = np.where(better, s[row, best], at[i])
        step /= 2
    at[depth == 0.0] = np.nan
    return depth, at


def _overlap_depths(
    screen: HandScreen, X_WG: Array, names: NDArray[np.object_], u_W: Array, s: Array
) -> Array:
    """Depths (N, S) in the named bodies (N,) at distances (N, S) along the paths [m]."""
    X = np.repeat(X_WG[:, None], s.shape[1], axis=1)
    X[..., :3, 3] += s[..., None] * u_W[:, None]
    depth = np.zeros(s.shape)
    for name in np.unique(names):
        rows = np.flatnonzero(names == name)
        _, found = screen.deepest(X[rows].reshape(-1, 4, 4), [str(name)])
        depth[rows] = found.reshape(len(rows), -1)
    return depth


@dataclass(frozen=True, eq=False)
class SweepResult:
    """Obstacles on the paths of N hands.

    Attributes:
        free: (N,) whether the path is free.
        blocker: (N,) name of the body in the way; "" where the path is free.
        clearance: (N,) smallest signed distance on the path [m]. Where it is free, the distance of
            the hand from other bodies: a lower bound, exact where no cylinder is swept across its
            axis (see `geometry.swept_shape`). Else minus the overlap depth with the blocker.
        at: (N,) distance from the grasp at which the hand overlaps by this depth [m]; NaN where the
            path is free, or the overlap too short to be found.
        room: (N,) how much deeper the held target may still get into bodies that it touches or
            overlaps at the start [m]; infinite without any.
    """

    free: NDArray[np.bool_]
    blocker: NDArray[np.object_]
    clearance: Array
    at: Array
    room: Array

    def __len__(self) -> int:
        return len(self.free)

    def add_blockers(self, rows: NDArray[np.intp], target: PathBlockers) -> None:
        """Enters what blocks the target on the paths `rows` (S,), and its room."""
        self.room[rows] = target.room
        hit = np.flatnonzero(target.by != "")
        rows = rows[hit]
        self.free[rows], self.blocker[rows] = False, target.by[hit]
        self.clearance[rows], self.at[rows] = -target.depth[hit], target.at[hit]


class HandSweep:
    """Sweeps a station's hand through one scene; objects stand where the document places them.

    Args:
        scene: the objects.
        station: the station with the hand.
        motion: the straight segments.

    Attributes:
        symmetric: whether the hand with its fingers swapped occupies the same space.

    Raises:
        InvalidInputError: the diagram cannot be built, or a collision geometry is of a shape that
            the hand's screen does not know.
    """

    def __init__(self, scene: Scene, station: Station, motion: GraspMotion) -> None:
        self._motion = motion
        diagram = build_station_diagram(scene, station, robot="hand")
        self._instances = tuple(diagram.free)
        self._order = ("table", *sorted(diagram.fixed), *sorted(diagram.free))
        self._parts, self._bodies = read_hand_parts(diagram)
        self.symmetric = is_hand_symmetric(self._parts)
        shapes = [shape for part in self._parts for shape in part.shapes]
        self._open = HandScreen(shapes, self._bodies)
        self._approach = HandScreen(_swept_shapes(shapes, motion.standoff), self._bodies)
        self._part_screens = [HandScreen(part.shapes, self._bodies) for part in self._parts]
        self._retreat = [
            HandScreen(_swept_shapes(part.shapes, motion.retreat), self._bodies)
            for part in self._parts
        ]
        self._swept_by_height: dict[float, dict[str, Body]] = {}
        self._lifts: dict[tuple[str, float], list[HandScreen]] = {}
        self._targets: dict[str, TargetSweep] = {}
        self._shared_lift_blockers: dict[tuple[str, float], PathBlockers] = {}

    def approach(self, instance: str, X_WG: Array) -> SweepResult:
        """Checks the open hand from the pregrasp to the grasp, both included.

        Args:
            instance: the target's name in the scene; "" if there is none. If several bodies are in
                the way, the target is named first.
            X_WG: (N, 4, 4) grasps in the world.

        Raises:
            UnknownNameError: there is no such instance.
            InvalidInputError: `X_WG` are not poses.
        """
        X_WG = self._checked(instance, X_WG)
        order = [*([instance] if instance else ()), *self._others(instance)]
        names = self._approach.deepest(X_WG, order)[0]
        clearance, at = np.empty(len(X_WG)), np.full(len(X_WG), np.nan)
        free, hit = np.flatnonzero(names == ""), np.flatnonzero(names != "")
        clearance[free] = self._approach.nearest(X_WG[free])[1]
        back_W = -X_WG[hit, :3, 2]
        depth, at[hit] = deepest_overlap_along_path(
            self._open, X_WG[hit], names[hit], back_W, self._motion.standoff
        )
        clearance[hit] = -depth
        return SweepResult(names == "", names, clearance, at, np.full(len(X_WG), np.inf))

    def retreat(self, instance: str, X_WG: Array, width: Array) -> SweepResult:
        """Checks the hand with the target straight back along the approach.

        Hand and fingers are checked against all bodies but the target, and the target against all
        others: where only the target collides, its obstacle is the blocker.

        Args:
            instance: the target's name in the scene; "" if the hand is empty.
            X_WG: (N, 4, 4) grasps in the world.
            width: (N,) distance between the pads once they hold the target [m]; the hand is open
                where it is NaN.

        Raises:
            UnknownNameError: there is no such instance.
            InvalidInputError: `X_WG` are not poses.
        """
        X_WG, length = self._checked(instance, X_WG), self._motion.retreat
        back_W = -X_WG[:, :3, 2]
        found = self._check_around_target(instance, self._retreat, X_WG, width, back_W, length)
        if instance:
            free = np.flatnonzero(found.free)
            found.add_blockers(free, self._target(instance).retreat(back_W[free], length))
        return found

    def lift(
        self, instance: str, X_WG: Array, width: Array, height: float | None = None
    ) -> SweepResult:
        """Checks the hand with the target on the lift, which begins where the retreat ends.

        Args:
            instance, X_WG, width: see `retreat`.
            height: height of the lift [m]; the whole lift if None.

        Raises:
            UnknownNameError: there is no such instance.
            InvalidInputError: `X_WG` are not poses.
        """
        X_WG, motion = self._checked(instance, X_WG), self._motion
        height = motion.lift_height if height is None else height
        start_W = -motion.retreat * X_WG[:, :3, 2]
        X_WR = X_WG.copy()
        X_WR[:, :3, 3] += start_W
        along_W = np.broadcast_to(motion.direction_W, (len(X_WG), 3))
        screens = self._lift_screens(instance, height)
        found = self._check_around_target(instance, screens, X_WR, width, along_W, height)
        if instance:
            free = np.flatnonzero(found.free)
            found.add_blockers(free, self._lift_blockers(instance, start_W[free], height))
        return found

    def _check_around_target(
        self,
        instance: str,
        screens: Sequence[HandScreen],
        X_WG: Array,
        width: Array,
        u_W: Array,
        length: float,
    ) -> SweepResult:
        """Checks the hand around the target on straight segments from N poses.

        Args:
            instance: the target, which is ignored.
            screens: for each part of the hand, a screen of its swept shapes, or of its shapes
                against the swept bodies.
            X_WG: (N, 4, 4) poses at which the segments begin.
            width: (N,) distance between the pads [m].
            u_W: (N, 3) unit vectors along the segments.
            length: length of the segments [m].
        """
        others = self._others(instance)
        placed = [part.placed(X_WG, np.asarray(width, float)) for part in self._parts]
        moves = list(zip(screens, placed, strict=True))
        ranks = np.array([_ranks(screen.deepest(X, others)[0], others) for screen, X in moves])
        names = np.array([*others, ""], dtype=object)[ranks.min(axis=0)]
        decisive = ranks.argmin(axis=0)
        clearance, at = np.full(len(X_WG), np.inf), np.full(len(X_WG), np.nan)
        free = np.flatnonzero(names == "")
        for k, (screen, X) in enumerate(moves):
            clearance[free] = np.minimum(clearance[free], screen.nearest(X[free])[1])
            hit = np.flatnonzero((names != "") & (decisive == k))
            depth, at[hit] = deepest_overlap_along_path(
                self._part_screens[k], X[hit], names[hit], u_W[hit], length
            )
            clearance[hit] = -depth
        return SweepResult(names == "", names, clearance, at, np.full(len(X_WG), np.inf))

    def _checked(self, instance: str, X_WG: Array) -> Array:
        if instance and instance not in self._instances:
            raise UnknownNameError(
                f"instance {instance!r} does not exist; {suggest_names(instance, self._instances)}"
            )
        return check_pose(X_WG, "X_WG")

    def _others(self, instance: str) -> list[str]:
        """Names of all bodies but the target, by their rank as blockers; see `HandClearance`."""
        return [name for name in self._order if name in self._bodies and name != instance]

    def _swept_bodies(self, height: float) -> dict[str, Body]:
        """All bodies, swept against the direction of the lift, in the frame of the lifted hand."""
        if height not in self._swept_by_height:
            shift_W = -height * self._motion.direction_W
            bodies = self._bodies.items()
            self._swept_by_height[height] = {
                name: swept_body(body, shift_W) for name, body in bodies
            }
        return self._swept_by_height[height]

    def _lift_screens(self, instance: str, height: float) -> list[HandScreen]:
        """The parts of the hand against the swept bodies."""
        key = instance, height
        if key not in self._lifts:
            swept = self._swept_bodies(height)
            others = {name: swept[name] for name in self._others(instance)}
            self._lifts[key] = [HandScreen(part.shapes, others) for part in self._parts]
        return self._lifts[key]

    def _target(self, instance: str) -> TargetSweep:
        if instance not in self._targets:
            others = {name: self._bodies[name] for name in self._others(instance)}
            self._targets[instance] = TargetSweep(self._bodies[instance], others)
        return self._targets[instance]

    def _lift_blockers(self, instance: str, start_W: Array, height: float) -> PathBlockers:
        """Obstacles of the target on the lift; without a retreat the same for all grasps."""
        target, u_W = self._target(instance), self._motion.direction_W
        swept = self._swept_bodies(height)
        if self._motion.retreat > 0.0:
            return target.lift(start_W, u_W, height, swept)
        key = instance, height
        if key not in self._shared_lift_blockers:
            self._shared_lift_blockers[key] = target.lift(np.zeros((1, 3)), u_W, height, swept)
        return self._shared_lift_blockers[key].repeated(len(start_W))


def _swept_shapes(shapes: Sequence[Shape], length: float) -> list[Shape]:
    """Swept volumes of shapes in the grasp frame on a straight retreat of `length` [m]."""
    backwards = np.array((0.0, 0.0, -1.0))  # Direction of the retreat, in the grasp frame.
    return [swept for shape in shapes for swept in swept_shape(shape, length * backwards)]


def _ranks(names: NDArray[np.object_], order: Sequence[str]) -> NDArray[np.intp]:
    """Ranks (N,) of names in an order; its length for names that are not in it."""
    rank = {name: i for i, name in enumerate(order)}
    return np.array([rank.get(name, len(order)) for name in names], dtype=np.intp)
