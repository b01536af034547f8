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

from burg_drake.station.body_shapes import PosedShapes

PLACES = 64
"""Bodies that there is room for at first; twice as many whenever there is none left."""
AWAY = 1e4
"""How far below the world, and below each other, bodies wait that are not there [m]."""


@dataclass(frozen=True, eq=False)
class Body:
    """A movable body in the scene graph, in use or waiting.

    Attributes:
        kind: what it is; all of a kind have the same shapes.
        index: the place it takes.
        geometries: its convex shapes.
    """

    kind: str
    index: int
    geometries: tuple[GeometryId, ...]


class CollisionWorld:
    """Movable bodies among fixed ones.

    Args:
        fixed: shapes of fixed bodies in the world, by name.
        shapes: gives those of a kind of body in the body's frame; asked once a kind.
    """

    def __init__(
        self, fixed: Mapping[str, PosedShapes], shapes: Callable[[str], PosedShapes]
    ) -> None:
        self._fixed, self._shapes = fixed, shapes
        self._known: dict[str, PosedShapes] = {}
        self._start(PLACES)

    def place(self, bodies: Mapping[str, tuple[str, RigidTransform]]) -> None:
        """Puts bodies in the place of those that were there before.

        Args:
            bodies: kind and pose `X_WB` of each by name; names are none of the fixed ones.
        """
        for name, body in list(self._used.items()):
            if name not in bodies or bodies[name][0] != body.kind:
                self._waiting.setdefault(body.kind, []).append(self._used.pop(name))
                self._poses.set_value(self._frames[body.index], _away(body.index))
        if self._taken + len(bodies) - len(self._used) > len(self._frames):
            self._start(2 * max(len(self._frames), len(bodies)))
        for name, (kind, X_WB) in bodies.items():
            if name not in self._used:
                waiting = self._waiting.get(kind)
                self._used[name] = waiting.pop() if waiting else self._new_body(kind)
            self._poses.set_value(self._frames[self._used[name].index], X_WB)
        self._owner: dict[GeometryId, str] = {
            g: name for name, body in self._used.items() for g in body.geometries
        }
        port = self._graph.get_source_pose_port(self._source)
        port.FixValue(self._context, Value(self._poses))

    def overlaps(self) -> dict[frozenset[str], float]:
        """Depth of the deepest overlap [m] of each pair of bodies that overlap, by their names; of
        two fixed ones none."""
        found: dict[frozenset[str], float] = {}
        for pair in self.query().ComputePointPairPenetration():
            names = [self._owner.get(g) or self._anchored.get(g) for g in (pair.id_A, pair.id_B)]
            if None not in names:
                key = frozenset(name for name in names if name is not None)
                found[key] = max(found.get(key, 0.0), pair.depth)
        return found

    def query(self) -> QueryObject:
        """Drake's answers about the bodies as they stand; good until they are moved."""
        return self._graph.get_query_output_port().Eval(self._context)

    def _start(self, places: int) -> None:
        """Makes the scene graph, with the fixed bodies alone."""
        graph = SceneGraph()
        source = graph.RegisterSource("bodies")
        frames = [graph.RegisterFrame(source, GeometryFrame(f"{i}")) for i in range(places)]
        self._anchored = {
            graph.RegisterAnchoredGeometry(source, _instance(f"{name}_{i}", *posed)): name
            for name, shapes in self._fixed.items()
            for i, posed in enumerate(shapes)
        }
        self._graph, self._source, self._frames = graph, source, frames
        self._context = graph.CreateDefaultContext()
        self._poses = FramePoseVector()
        for index, frame in enumerate(frames):
            self._poses.set_value(frame, _away(index))
        self._taken = 0
        self._used: dict[str, Body] = {}
        self._waiting: dict[str, list[Body]] = {}

    def _new_body(self, kind: str) -> Body:
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
        return Body(kind, index, geometries)


def _instance(name: str, X_FG: RigidTransform, shape: Shape) -> GeometryInstance:
    instance = GeometryInstance(X_FG, shape, name)
    instance.set_proximity_properties(ProximityProperties())
    return instance


def _away(index: int) -> RigidTransform:
    return RigidTransform([0.0, 0.0, -AWAY * (index + 1)])
