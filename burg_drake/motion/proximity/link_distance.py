"""The distance between bodies of the robot, at many configurations of the joints between them.

By the project's own search (`geometry.distance`), as Drake's is wrong by centimetres for some boxes
with parallel edges (drake 1.51), and a table is trusted for all that lies around its entries.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydrake.geometry import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    GeometryId,
    Mesh,
    SceneGraphInspector,
    Sphere,
)
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array, InvalidInputError, transform_points
from burg_drake.geometry import Cores, Poses, distances
from burg_drake.motion.ik import ArmLinks
from burg_drake.station.diagram import StationDiagram

BLOCK = 2**16
"""Pairs of shapes that are looked at together, for the sake of memory."""


@dataclass(frozen=True, eq=False)
class _Core:
    """A shape as the sum of a polytope, a disc and a ball, in its own frame.

    Attributes:
        vertices: (V, 3) [m].
        disc: radius of the disc across z [m].
        ball: radius of the ball [m].
    """

    vertices: Array
    disc: float = 0.0
    ball: float = 0.0


class LinkDistance:
    """The distance of one body of the robot from others that lie in one frame of the arm."""

    def __init__(
        self,
        station_diagram: StationDiagram,
        links: ArmLinks,
        body: BodyIndex,
        others: Sequence[BodyIndex],
    ) -> None:
        """Reads the collision geometry of the bodies.

        Raises:
            InvalidInputError: a geometry is of a shape that is not known.
        """
        self._links = links
        self._joints = tuple(range(links.frame_of[body], links.frame_of[others[0]]))
        self._one = _cores(station_diagram, links, others)
        self._other = _cores(station_diagram, links, [body])
        pairs = np.indices((len(self._one.ball), len(self._other.ball))).reshape(2, -1)
        self._shape, self._piece = pairs
        self._balls = self._one.ball[self._shape] + self._other.ball[self._piece]

    def at(self, positions: Array, ceiling: float) -> Array:
        """Distances [m].

        Args:
            positions: (C, m) of the joints between the bodies [rad or m].
            ceiling: what is farther apart may count as infinitely far [m].

        Returns:
            (C,) distances. Of bodies that overlap it is 0 or less: they do so at least as deeply,
            as far as that is known.
        """
        size = max(1, BLOCK // self.pairs)
        blocks = [positions[start : start + size] for start in range(0, len(positions), size)]
        found = [self._at(block, ceiling) for block in blocks]
        return np.concatenate([np.empty(0), *found])

    @property
    def pairs(self) -> int:
        """Pairs of shapes of which each configuration takes the least distance."""
        return len(self._balls)

    def _at(self, positions: Array, ceiling: float) -> Array:
        X = Poses.of(self._links.between(self._joints, positions))
        pair = np.tile(np.arange(self.pairs), len(positions))
        which = np.repeat(np.arange(len(positions)), self.pairs)
        of_cores = distances(
            replace(self._one, ball=np.zeros_like(self._one.ball)),
            self._shape[pair],
            replace(self._other, ball=np.zeros_like(self._other.ball)),
            self._piece[pair],
            X[which],
            ceiling + self._balls[pair],
        )
        found = of_cores - self._balls[pair]
        return np.asarray(found.reshape(len(positions), self.pairs).min(axis=1))


def _cores(station_diagram: StationDiagram, links: ArmLinks, bodies: Sequence[BodyIndex]) -> Cores:
    """The collision geometry of bodies, in the arm's frame."""
    plant = station_diagram.plant
    inspector = station_diagram.scene_graph.model_inspector()
    cores, poses = [], []
    for body in bodies:
        for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(body)):
            cores.append(_core(inspector, geometry))
            poses.append(links.X_FB[body] @ inspector.GetPoseInFrame(geometry).GetAsMatrix4())
    vertices = [transform_points(X, core.vertices) for X, core in zip(poses, cores, strict=True)]
    count = np.array([len(v) for v in vertices])
    corners = np.arange(count.max())
    filled = np.array([v[np.where(corners < len(v), corners, 0)] for v in vertices])
    x, y, z = np.ascontiguousarray(np.moveaxis(filled, -1, 0))
    X = np.array(poses)
    return Cores(
        *(x, y, z, count),
        center=np.array([v.mean(axis=0) for v in vertices]),
        across=(X[:, :3, 0].T.copy(), X[:, :3, 1].T.copy()),
        disc=np.array([core.disc for core in cores]),
        ball=np.array([core.ball for core in cores]),
    )


def _core(inspector: SceneGraphInspector, geometry: GeometryId) -> _Core:
    shape = inspector.GetShape(geometry)
    match shape:
        case Sphere():
            return _Core(np.zeros((1, 3)), ball=shape.radius())
        case Capsule():
            return _Core(_rod(shape.length()), ball=shape.radius())
        case Cylinder():
            return _Core(_rod(shape.length()), disc=shape.radius())
        case Box():
            signs = np.indices((2, 2, 2)).reshape(3, -1).T - 0.5
            return _Core(signs * shape.size())
        case Convex() | Mesh():
            hull = inspector.GetConvexHull(geometry)
            return _Core(np.array([hull.vertex(i) for i in range(hull.num_vertices())]))
    raise InvalidInputError(
        f"collision geometry {inspector.GetName(geometry)!r} of the robot is a"
        f" {type(shape).__name__}; supported are boxes, capsules, cylinders, spheres and convex"
        " meshes"
    )


def _rod(length: float) -> Array:
    return np.array([(0.0, 0.0, -length / 2), (0.0, 0.0, length / 2)])
