"""Movable bodies among fixed ones: overlaps, and distances that bodies move to first contact."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.geometry import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    Ellipsoid,
    FramePoseVector,
    GeometryFrame,
    GeometryId,
    GeometryInstance,
    Mesh,
    ProximityProperties,
    QueryObject,
    SceneGraph,
    SceneGraphInspector,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.planning import RobotDiagramBuilder

from burg_drake.core import Array, Indices, InvalidInputError, Packages
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import ConvexShapes, Instance, Scene, SceneDocument, contact_distances
from burg_drake.station.engine import ENGINES
from burg_drake.station.model_file import set_packages
from burg_drake.station.object_bodies import add_instance
from burg_drake.station.station_diagram import StationDiagram
from burg_drake.station.visible_triangles import hull_vertices

PosedShapes = tuple[tuple[RigidTransform, Shape], ...]
"""Convex shapes with their poses in one frame. Drake takes a mesh for its convex hull."""


def read_object_shapes(library: ObjectLibrary, name: str, packages: Packages) -> PosedShapes:
    """Shapes of an object in its own frame; those of a rigid mesh are its convex pieces.

    Args:
        library: library with the object.
        name: name of the object.
        packages: the station's package folders.

    Raises:
        UnknownNameError: no such object.
        InvalidInputError: its model cannot be loaded, or its mass differs from the library's.
    """
    instance_name = "alone"  # Name of the only instance in the plant.
    instance = Instance(name=instance_name, object=name)
    document = SceneDocument(name=instance_name, library=str(library.root), instances=(instance,))
    scene = Scene(document, library, library.root)
    builder = RobotDiagramBuilder(time_step=ENGINES["standard"].time_step)
    set_packages(builder.parser(), {})
    builder.parser().SetAutoRenaming(True)
    body = add_instance(builder, scene, packages, instance_name, by_pieces=True)
    inspector = builder.scene_graph().model_inspector()
    return _body_shapes(builder.plant(), inspector, body, RigidTransform())


def surrounding_shapes(station_diagram: StationDiagram) -> dict[str, PosedShapes]:
    """Shapes of the station in the world by name: table, obstacles, and the robot's links in the
    home posture."""
    plant, inspector = station_diagram.plant, station_diagram.scene_graph.model_inspector()
    obstacles = station_diagram.station.document.background
    bodies = {"table": station_diagram.table}
    bodies |= {name: station_diagram.fixed[name] for name in obstacles}
    bodies |= {plant.get_body(i).name(): i for i in station_diagram.robot_bodies}
    context = plant.CreateDefaultContext()
    return {
        name: _body_shapes(plant, inspector, body, plant.EvalBodyPoseInWorld(context, body))
        for name, body in ((name, plant.get_body(i)) for name, i in bodies.items())
    }


def _body_shapes(
    plant: MultibodyPlant, inspector: SceneGraphInspector, body: RigidBody, X_FB: RigidTransform
) -> PosedShapes:
    return tuple(
        (X_FB @ inspector.GetPoseInFrame(geometry), inspector.GetShape(geometry))
        for geometry in plant.GetCollisionGeometriesForBody(body)
    )


@dataclass(frozen=True, eq=False)
class MovableBody:
    """A movable body in the scene graph, active or parked.

    Attributes:
        kind: kind of body; all bodies of a kind have the same shapes.
        slot: index of its frame in the scene graph.
        geometries: its convex shapes.
    """

    kind: str
    slot: int
    geometries: tuple[GeometryId, ...]


Depths = dict[tuple[str, str], float]


class CollisionWorld:
    """Movable bodies among fixed ones.

    Args:
        fixed: shapes of fixed bodies in the world, by name.
        shapes: returns the shapes of a kind of body in the body's frame; called once per kind.
        slots: number of frames for movable bodies; with more bodies the scene graph is rebuilt.

    Attributes:
        fixed: shapes of the fixed bodies.
        anchored: names of fixed bodies by geometry, in the order of their shapes.
    """

    def __init__(
        self,
        fixed: Mapping[str, PosedShapes],
        shapes: Callable[[str], PosedShapes],
        slots: int = 256,
    ) -> None:
        self.fixed, self._read_shapes = fixed, shapes
        self._shapes_by_kind: dict[str, PosedShapes] = {}
        self._build_scene_graph(slots)

    def place(self, bodies: Mapping[str, tuple[str, RigidTransform]]) -> None:
        """Replaces the movable bodies.

        Args:
            bodies: kind and pose `X_WB` of each body by name; names must differ from those of fixed
                bodies.
        """
        for name, body in list(self._active.items()):
            if name not in bodies or bodies[name][0] != body.kind:
                self._parked.setdefault(body.kind, []).append(self._active.pop(name))
                self._frame_poses.set_value(self._frames[body.slot], _parking_pose(body.slot))
        if self._n_used_slots + len(bodies) - len(self._active) > len(self._frames):
            self._build_scene_graph(max(len(self._frames), 2 * len(bodies)))
        for name, (kind, X_WB) in bodies.items():
            if name not in self._active:
                parked = self._parked.get(kind)
                self._active[name] = parked.pop() if parked else self._new_body(kind)
            self._frame_poses.set_value(self._frames[self._active[name].slot], X_WB)
        self._owner = {g: name for name in bodies for g in self._active[name].geometries}
        self._bodies: dict[str, tuple[str, RigidTransform]] = dict(bodies)
        port = self._graph.get_source_pose_port(self._source)
        port.FixValue(self._context, Value(self._frame_poses))

    @property
    def bodies(self) -> Mapping[str, tuple[str, RigidTransform]]:
        """Kind and pose `X_WB` of each movable body, as passed to `place`."""
        return self._bodies

    def geometries(self, name: str) -> tuple[GeometryId, ...]:
        """Geometries of a movable body, in the order of its shapes."""
        return self._active[name].geometries

    def shapes(self, name: str) -> PosedShapes:
        """Shapes of a movable body in its frame."""
        return self._shapes_by_kind[self._active[name].kind]

    def overlaps(self) -> tuple[Depths, Depths]:
        """Overlaps of the movable bodies.

        Returns:
            Depths of the deepest overlaps [m]: of each overlapping pair of movable bodies, named in
            the order of `bodies`, and of each movable body with a fixed one.
        """
        order = {name: i for i, name in enumerate(self._bodies)}
        among: Depths = {}
        fixed: Depths = {}
        for pair in self.query().ComputePointPairPenetration():
            ids = (pair.id_A, pair.id_B)
            movable = [self._owner[g] for g in ids if g in self._owner]
            still = [self.anchored[g] for g in ids if g in self.anchored]
            if len(movable) == 2:
                a, b = sorted(movable, key=order.__getitem__)
                among[a, b] = max(among.get((a, b), 0.0), pair.depth)
            elif movable and still:
                key = movable[0], still[0]
                fixed[key] = max(fixed.get(key, 0.0), pair.depth)
        return among, fixed

    def touched(self, name: str, gap: float) -> set[str]:
        """Movable and fixed bodies that are closer to a movable body than `gap` [m]."""
        own = set(self.geometries(name))
        owner = {**self.anchored, **self._owner}
        pairs = self.query().ComputeSignedDistancePairwiseClosestPoints(gap)
        ids = ((pair.id_A, pair.id_B) for pair in pairs)
        others = {b if a in own else a for a, b in ids if (a in own) != (b in own)}
        return {owner[g] for g in others if g in owner}

    def query(self) -> QueryObject:
        """Drake's geometry queries for the current poses; valid until bodies are moved."""
        return self._graph.get_query_output_port().Eval(self._context)

    def _build_scene_graph(self, slots: int) -> None:
        """Creates the scene graph with only the fixed bodies."""
        graph = SceneGraph()
        source = graph.RegisterSource("bodies")
        frames = [graph.RegisterFrame(source, GeometryFrame(f"{i}")) for i in range(slots)]
        self.anchored = {
            graph.RegisterAnchoredGeometry(
                source, _make_geometry_instance(f"{name}_{i}", *posed)
            ): name
            for name, shapes in self.fixed.items()
            for i, posed in enumerate(shapes)
        }
        self._graph, self._source, self._frames = graph, source, frames
        self._context = graph.CreateDefaultContext()
        self._frame_poses = FramePoseVector()
        for slot, frame in enumerate(frames):
            self._frame_poses.set_value(frame, _parking_pose(slot))
        self._n_used_slots = 0
        self._active: dict[str, MovableBody] = {}
        self._parked: dict[str, list[MovableBody]] = {}

    def _new_body(self, kind: str) -> MovableBody:
        """Registers a body at the next unused slot."""
        if kind not in self._shapes_by_kind:
            self._shapes_by_kind[kind] = self._read_shapes(kind)
        slot = self._n_used_slots
        frame = self._frames[slot]
        geometries = tuple(
            self._graph.RegisterGeometry(
                self._context, self._source, frame, _make_geometry_instance(f"{i}", *posed)
            )
            for i, posed in enumerate(self._shapes_by_kind[kind])
        )
        self._n_used_slots += 1
        return MovableBody(kind, slot, geometries)


def _make_geometry_instance(name: str, X_FG: RigidTransform, shape: Shape) -> GeometryInstance:
    instance = GeometryInstance(X_FG, shape, name)
    instance.set_proximity_properties(ProximityProperties())
    return instance


def _parking_pose(slot: int) -> RigidTransform:
    parking_distance = 1e4  # Metres below the world, and between parked bodies.
    return RigidTransform([0.0, 0.0, -parking_distance * (slot + 1)])


class BodySweep:
    """Straight motion of bodies of a collision world up to the first contact. The shapes of each
    kind of body are converted once.

    Args:
        world: the collision world.
    """

    def __init__(self, world: CollisionWorld) -> None:
        self._world = world
        self._fixed = {n: _convex_shapes(shapes) for n, shapes in world.fixed.items() if shapes}
        self._shapes_by_kind: dict[str, ConvexShapes] = {}

    def first_contact(
        self, names: Sequence[str], direction: Array, limit: float
    ) -> tuple[float, str]:
        """How far bodies can be moved together, and the first body that they meet.

        Args:
            names: names of movable bodies, at least one.
            direction: (3,) unit vector in the world.
            limit: longest distance [m].

        Returns:
            The distance [m], at most `limit`, and the name of the movable or fixed body that is
            met; "" if there is none within the limit.
        """
        start_gap = 5e-6  # Metres between touching shapes at the start.
        sliding_cosine = 1e-2  # Cosine between motion and contact normal up to which shapes slide.
        others = [name for name in self._world.bodies if name not in names]
        moving = ConvexShapes.joined([self._shapes(name) for name in names])
        shapes = [*map(self._shapes, others), *self._fixed.values()]
        still = ConvexShapes.joined(shapes)
        i, j = (index.ravel() for index in np.indices((len(moving), len(still))))
        offsets, closing_cosine = np.zeros((len(i), 3)), np.zeros(len(i))
        near = np.flatnonzero(_boxes_near(moving, still))
        normals = self._normals(names, others, (i[near], j[near]))
        gap = (moving.support(i[near], -normals) - still.support(j[near], normals)) * normals
        gap_deficit = np.maximum(start_gap - gap.sum(axis=1), 0.0)
        offsets[near] = gap_deficit[:, None] * normals
        closing_cosine[near] = np.where(gap_deficit > 0.0, -(normals @ direction), 0.0)
        found = contact_distances(moving, still, (i, j), direction, limit, offsets)
        pressing = closing_cosine > sliding_cosine
        start_motion = 2.0 * start_gap / np.maximum(closing_cosine, sliding_cosine)
        found[pressing & (found <= start_motion)] = 0.0
        first = int(found.argmin())
        if not np.isfinite(found[first]):
            return limit, ""
        owners = np.repeat([*others, *self._fixed], [len(s) for s in shapes])
        return float(found[first]), str(owners[j[first]])

    def _shapes(self, name: str) -> ConvexShapes:
        """Shapes of a movable body in the world."""
        kind, X_WB = self._world.bodies[name]
        if kind not in self._shapes_by_kind:
            self._shapes_by_kind[kind] = _convex_shapes(self._world.shapes(name))
        return self._shapes_by_kind[kind].moved(X_WB.GetAsMatrix4())

    def _normals(
        self, names: Sequence[str], others: Sequence[str], pairs: tuple[Indices, Indices]
    ) -> Array:
        """Contact normals (K, 3): unit vectors along which shapes of moving bodies separate from
        others by the shortest motion.

        Drake has no normals at distances that are rounding errors. So the moving bodies are placed
        in the world with a small offset, with the opposite one for normals that are still missing,
        and at the end where they were.
        """
        offset = np.array([4.8e-7, 6e-7, 6.4e-7])  # Metres.
        moving = [g for name in names for g in self._world.geometries(name)]
        still = [g for name in others for g in self._world.geometries(name)]
        still += self._world.anchored
        geometries = [(moving[i], still[j]) for i, j in zip(*pairs, strict=True)]
        normals = np.full((len(geometries), 3), np.nan)
        bodies = self._world.bodies
        for translation in (offset, -offset):
            X_offset = RigidTransform(translation)
            moved = {name: (bodies[name][0], X_offset @ bodies[name][1]) for name in names}
            self._world.place({**bodies, **moved})
            for k in np.flatnonzero(np.isnan(normals).any(axis=1)):
                normals[k] = self._normal(*geometries[k])
        self._world.place(bodies)
        return np.asarray(np.nan_to_num(normals))

    def _normal(self, a: GeometryId, b: GeometryId) -> Array:
        """Contact normal (3,) that points from b to a."""
        pair = self._world.query().ComputeSignedDistancePairClosestPoints(a, b)
        return np.asarray(pair.nhat_BA_W if pair.id_A == a else -pair.nhat_BA_W)


def _boxes_near(a: ConvexShapes, b: ConvexShapes) -> NDArray[np.bool_]:
    """(A, B) whether the bounding boxes of two shapes are near each other."""
    near_distance = 1e-4  # Metres; Drake's distances of cylinders are wrong by up to 3e-5 m.
    (low_a, high_a), (low_b, high_b) = a.boxes(), b.boxes()
    near = (low_a[:, None] <= high_b + near_distance) & (low_b <= high_a[:, None] + near_distance)
    return np.asarray(near.all(axis=2))


def _convex_shapes(posed: PosedShapes) -> ConvexShapes:
    """Drake's shapes, converted and expressed in the frame of their poses."""
    return ConvexShapes.joined(
        [_convex_shape(shape).moved(X_FG.GetAsMatrix4()) for X_FG, shape in posed]
    )


def _convex_shape(shape: Shape) -> ConvexShapes:
    """One of Drake's shapes, converted and in its own frame."""
    middle, flat = np.zeros((1, 3)), np.zeros((3, 3))
    if isinstance(shape, Box):
        corners = np.stack(np.meshgrid(*([-0.5, 0.5],) * 3), axis=-1).reshape(-1, 3)
        return ConvexShapes.of([corners * shape.size()], [flat])
    if isinstance(shape, Sphere):
        return ConvexShapes.of([middle], [shape.radius() * np.eye(3)])
    if isinstance(shape, Ellipsoid):
        return ConvexShapes.of([middle], [np.diag([shape.a(), shape.b(), shape.c()])])
    if isinstance(shape, (Capsule, Cylinder)):
        ends = np.array([[0.0, 0.0, z * shape.length()] for z in (-0.5, 0.5)])
        round_in = [1.0, 1.0, 0.0 if isinstance(shape, Cylinder) else 1.0]
        return ConvexShapes.of([ends], [shape.radius() * np.diag(round_in)])
    if isinstance(shape, (Convex, Mesh)):
        return ConvexShapes.of([hull_vertices(shape)], [flat])
    raise InvalidInputError(
        f"a shape of kind {type(shape).__name__} cannot be checked for how far it can move"
    )
