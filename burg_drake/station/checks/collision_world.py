"""Bodies that are moved, added and removed between two questions about what overlaps.

A scene graph of its own, without a plant: parsing models and building a diagram takes most of the
time of a single question. A body that is removed waits far away for the next one of its kind.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from pydrake.common.value import Value
from pydrake.geometry import (
    FramePoseVector,
    GeometryFrame,
    GeometryId,
    GeometryInstance,
    ProximityProperties,
    QueryObject,
    SceneGraph,
    Shape,
)
from pydrake.math import RigidTransform

from burg_drake.station.checks.body_shapes import PosedShapes

PLACES = 256
"""Bodies that there is room for at first, those that wait included."""
PARKING_HEIGHT = 1e4
"""How far below the world, and below each other, bodies wait that are not there [m]."""


@dataclass(frozen=True, eq=False)
class MovableBody:
    """A movable body in the scene graph, in use or waiting.

    Attributes:
        kind: what it is; all of a kind have the same shapes.
        index: the place it takes.
        geometries: its convex shapes.
    """

    kind: str
    index: int
    geometries: tuple[GeometryId, ...]


Depths = dict[tuple[str, str], float]


class CollisionWorld:
    """Movable bodies among fixed ones.

    Args:
        fixed: shapes of fixed bodies in the world, by name.
        shapes: gives those of a kind of body in the body's frame; asked once a kind.
        places: bodies that there is room for before the scene graph is made anew.

    Attributes:
        fixed: those shapes.
        anchored: names of fixed bodies by geometry, in the order of their shapes.
    """

    def __init__(
        self,
        fixed: Mapping[str, PosedShapes],
        shapes: Callable[[str], PosedShapes],
        places: int = PLACES,
    ) -> None:
        self.fixed, self._shapes = fixed, shapes
        self._known: dict[str, PosedShapes] = {}
        self._start(places)

    def place(self, bodies: Mapping[str, tuple[str, RigidTransform]]) -> None:
        """Puts bodies in the place of those that were there before.

        Args:
            bodies: kind and pose `X_WB` of each by name; names are none of the fixed ones.
        """
        for name, body in list(self._used.items()):
            if name not in bodies or bodies[name][0] != body.kind:
                self._waiting.setdefault(body.kind, []).append(self._used.pop(name))
                self._frame_poses.set_value(self._frames[body.index], _parking_pose(body.index))
        if self._taken + len(bodies) - len(self._used) > len(self._frames):
            self._start(max(len(self._frames), 2 * len(bodies)))
        for name, (kind, X_WB) in bodies.items():
            if name not in self._used:
                waiting = self._waiting.get(kind)
                self._used[name] = waiting.pop() if waiting else self._new_body(kind)
            self._frame_poses.set_value(self._frames[self._used[name].index], X_WB)
        self._owner = {g: name for name in bodies for g in self._used[name].geometries}
        self._bodies: dict[str, tuple[str, RigidTransform]] = dict(bodies)
        port = self._graph.get_source_pose_port(self._source)
        port.FixValue(self._context, Value(self._frame_poses))

    @property
    def bodies(self) -> Mapping[str, tuple[str, RigidTransform]]:
        """Kind and pose `X_WB` of what is there, as it was placed."""
        return self._bodies

    def geometries(self, name: str) -> tuple[GeometryId, ...]:
        """Those of a movable body that is there, in the order of its shapes."""
        return self._used[name].geometries

    def shapes(self, name: str) -> PosedShapes:
        """Those of a movable body that is there, in its frame."""
        return self._known[self._used[name].kind]

    def overlaps(self) -> tuple[Depths, Depths]:
        """Which bodies overlap.

        Returns:
            Depth of the deepest overlap [m] of each pair of movable bodies that overlap, in the
            order in which they were placed, and of each movable body with a fixed one.
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
        """Bodies, fixed ones among them, that are closer to a movable one than `gap` [m]."""
        own = set(self.geometries(name))
        owner = {**self.anchored, **self._owner}
        pairs = self.query().ComputeSignedDistancePairwiseClosestPoints(gap)
        ids = ((pair.id_A, pair.id_B) for pair in pairs)
        others = {b if a in own else a for a, b in ids if (a in own) != (b in own)}
        return {owner[g] for g in others if g in owner}

    def query(self) -> QueryObject:
        """Drake's answers about the bodies as they stand; good until they are moved."""
        return self._graph.get_query_output_port().Eval(self._context)

    def _start(self, places: int) -> None:
        """Makes the scene graph, with the fixed bodies alone."""
        graph = SceneGraph()
        source = graph.RegisterSource("bodies")
        frames = [graph.RegisterFrame(source, GeometryFrame(f"{i}")) for i in range(places)]
        self.anchored = {
            graph.RegisterAnchoredGeometry(source, _instance(f"{name}_{i}", *posed)): name
            for name, shapes in self.fixed.items()
            for i, posed in enumerate(shapes)
        }
        self._graph, self._source, self._frames = graph, source, frames
        self._context = graph.CreateDefaultContext()
        self._frame_poses = FramePoseVector()
        for index, frame in enumerate(frames):
            self._frame_poses.set_value(frame, _parking_pose(index))
        self._taken = 0
        self._used: dict[str, MovableBody] = {}
        self._waiting: dict[str, list[MovableBody]] = {}

    def _new_body(self, kind: str) -> MovableBody:
        """Registers a body at the next place."""
        if kind not in self._known:
            self._known[kind] = self._shapes(kind)
        index, frame = self._taken, self._frames[self._taken]
        geometries = tuple(
            self._graph.RegisterGeometry(
                self._context, self._source, frame, _instance(f"{i}", *posed)
            )
            for i, posed in enumerate(self._known[kind])
        )
        self._taken += 1
        return MovableBody(kind, index, geometries)


def _instance(name: str, X_FG: RigidTransform, shape: Shape) -> GeometryInstance:
    instance = GeometryInstance(X_FG, shape, name)
    instance.set_proximity_properties(ProximityProperties())
    return instance


def _parking_pose(index: int) -> RigidTransform:
    return RigidTransform([0.0, 0.0, -PARKING_HEIGHT * (index + 1)])
