"""The surfaces of a scene's objects as one mesh, their contours and their footprints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from burg_drake.core import (
    Array,
    Booleans,
    Indices,
    UnknownNameError,
    suggest_names,
    transform_points,
)
from burg_drake.geometry import RayCaster
from burg_drake.scene import Scene


@dataclass(frozen=True, eq=False)
class MeshContour:
    """Contour edges of a mesh from a point of view.

    Attributes:
        edges: (N,) indices into `MeshOutline.edges`.
        faces: (N,) a front face at each edge; for open edges the only face.
    """

    edges: Indices
    faces: Indices


class MeshOutline:
    """A mesh prepared for contours from any point of view.

    Closed surfaces wound outward have exact contours. The boundary of an open surface counts as
    contour. Surfaces that touch along an edge are separated into pairs of faces.

    Attributes:
        vertices: (V, 3) in the object frame O [m].
        faces: (F, 3) corners of the non-degenerate triangles.
        kept: (F,) indices of these triangles among the given faces.
        edges: (E, 2) vertices at the edges' ends; an edge with more than two faces is repeated for
            every pair.
        sides: (E, 2) faces at each edge; the second is -1 for an open one.
    """

    def __init__(self, vertices: Array, faces: Indices) -> None:
        """Prepares a mesh.

        Args:
            vertices: (V, 3) [m]; coinciding vertices must be merged.
            faces: (F, 3) corners, counter-clockwise seen from outside.
        """
        self.vertices = np.asarray(vertices, dtype=float)
        corners = self.vertices[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(normals, axis=1)
        self.kept = np.flatnonzero(area > 0.0)
        self.faces = np.asarray(faces, dtype=np.int64)[self.kept]
        normals = normals[self.kept] / area[self.kept, None]
        offsets = -np.einsum("ij,ij->i", normals, corners[self.kept, 0])
        self._planes = np.column_stack([normals, offsets])
        self.edges, self.sides = _mesh_edges(self.faces)
        self._bend_angle = self._bends()
        self._open = self.sides[:, 1] < 0
        self._open_edges = np.flatnonzero(self._open)
        self._convex = ~self._open & (self._bend_angle > 0.0)
        self._first, self._second = self.sides.T.copy()

    @property
    def normals(self) -> Array:
        """(F, 3) unit normals of the faces in O."""
        return self._planes[:, :3]

    def contour(self, p_OC: Array) -> MeshContour:
        """The contour from a point of view.

        Concave edges are left out: one of their faces hides them.

        Args:
            p_OC: (3,) point of view in O [m].
        """
        front = self.front(p_OC)
        turns = (front[self._first] != front[self._second]) & self._convex
        edges = np.flatnonzero(turns)
        first, second = self.sides[edges].T
        faces = np.where(front[first], first, second)
        return MeshContour(
            np.concatenate([edges, self._open_edges]),
            np.concatenate([faces, self._first[self._open_edges]]),
        )

    def front(self, p_OC: Array, faces: Indices | None = None) -> Booleans:
        """(F,) True for faces whose front is towards a point of view in O; occlusion is ignored.

        Args:
            p_OC: (3,) [m].
            faces: indices of faces, in the shape of the result; all (F,) if None.
        """
        planes = self._planes if faces is None else self._planes[faces]
        return np.asarray(planes @ np.append(p_OC, 1.0) > 0.0)

    @cached_property
    def creases(self) -> Indices:
        """(N,) edges at which the surface bends by more than 35 degrees, in connected creases of at
        least 2 cm.
        """
        # Radians between two faces.
        sharp = np.flatnonzero((np.abs(self._bend_angle) > np.deg2rad(35.0)) & ~self._open)
        starts, ends = self.edges[sharp].T
        graph = coo_array((np.ones(len(sharp)), (starts, ends)), shape=(len(self.vertices),) * 2)
        _, group = connected_components(graph, directed=False)
        length = np.linalg.norm(self.vertices[ends] - self.vertices[starts], axis=1)
        whole = np.bincount(group[starts], length)
        # Metres. Shorter creases are bumps of a scan.
        return np.asarray(sharp[whole[group[starts]] > 0.02])

    def _bends(self) -> Array:
        """(E,) angle between the faces at an edge, positive if convex [rad]."""
        first, second = self.normals[self.sides[:, 0]], self.normals[self.sides[:, 1]]
        across = np.linalg.norm(np.cross(first, second), axis=1)
        angle = np.arctan2(across, np.einsum("ij,ij->i", first, second))
        middle = self.vertices[self.faces].mean(axis=1)
        offset = middle[self.sides[:, 1]] - middle[self.sides[:, 0]]
        signed: Array = np.where(np.einsum("ij,ij->i", first, offset) <= 0.0, angle, -angle)
        return signed


def _mesh_edges(faces: Indices) -> tuple[Indices, Indices]:
    """Edges (E, 2) and their two faces (E, 2), -1 for a missing second one."""
    pairs = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(faces)), 3)
    order = np.lexsort(pairs.T)
    pairs, owner = pairs[order], owner[order]
    new = np.ones(len(pairs) + 1, bool)
    new[1:-1] = (pairs[1:] != pairs[:-1]).any(axis=1)
    alone = new[:-1] & new[1:]
    joined = np.flatnonzero(~new[1:-1])  # this pair and the next are the same edge
    edges = np.concatenate([pairs[alone], pairs[joined]])
    single = np.column_stack([owner[alone], np.full(int(alone.sum()), -1)])
    double = np.column_stack([owner[joined], owner[joined + 1]])
    return edges, np.concatenate([single, double])


TriangleArrays = tuple[Array, Indices]


class SceneMesh:
    """The visible surfaces of a scene.

    Attributes:
        names: instances, free ones first, in the scene's order; the index is the instance's number.
        outline: all surfaces as one mesh; its frame is S.
        owner: (F,) number of the instance that each face of `outline` belongs to.
        boxes: (N, 2, 3) corners of each instance's bounding box along the axes of S [m].
    """

    def __init__(self, placed: dict[str, TriangleArrays]) -> None:
        """Joins surfaces.

        Args:
            placed: surfaces by instance: vertices (V, 3) in S [m] and faces (F, 3).
        """
        self._placed = placed
        self.names = tuple(placed)
        vertices = [np.empty((0, 3)), *(v for v, _ in placed.values())]
        starts = np.cumsum([len(v) for v in vertices])
        faces = [f + start for (_, f), start in zip(placed.values(), starts, strict=False)]
        owner = np.repeat(np.arange(len(faces)), [len(f) for f in faces])
        joined = np.concatenate([np.empty((0, 3), np.int64), *faces])
        self.outline = MeshOutline(np.concatenate(vertices), joined)
        self.owner: Indices = owner[self.outline.kept]
        corners = [[v.min(axis=0), v.max(axis=0)] for v in vertices[1:]]
        self.boxes: Array = np.array(corners).reshape(-1, 2, 3)

    def select(self, names: tuple[str, ...] | None) -> SceneMesh:
        """Mesh of some of the instances; of all if None.

        Raises:
            UnknownNameError: there is no such instance.
        """
        if names is None:
            return self
        for name in names:
            if name not in self._placed:
                raise UnknownNameError(
                    f"instance {name!r} does not exist; {suggest_names(name, self.names)}"
                )
        return SceneMesh({name: self._placed[name] for name in names})

    def vertices(self, name: str) -> Array:
        """(V, 3) of an instance, in S [m]."""
        return self._placed[name][0]

    @cached_property
    def rays(self) -> RayCaster:
        """Ray caster for the surfaces, in S."""
        return RayCaster(self.outline.vertices, self.outline.faces)


def build_scene_mesh(scene: Scene) -> SceneMesh:
    """The surfaces of all instances of a scene, background included, at their places.

    Raises:
        UnknownNameError: a mesh file of the library is missing.
    """
    placed = {}
    for name in (*scene.instances, *scene.background):
        surface = scene.library.surface(scene.instance(name).object)
        faces = np.asarray(surface.faces, dtype=np.int64)
        placed[name] = transform_points(scene.X_SO(name), surface.vertices), faces
    return SceneMesh(placed)


def object_footprints(shape: SceneMesh) -> tuple[Array, Indices]:
    """Convex outlines of the objects' contact areas on the board.

    Returns:
        (N, 2, 3) ends of lines in S, in the plane of the board [m], and (N,) numbers of the lines'
        instances; no lines for objects that stand on others.
    """
    lines, owner = [np.empty((0, 2, 3))], [np.empty(0, np.int64)]
    for number, name in enumerate(shape.names):
        vertices = shape.vertices(name)
        # Metres. Lower points of an object are in contact with the board.
        contact = vertices[vertices[:, 2] <= 2e-3, :2]
        try:
            corners = contact[ConvexHull(contact).vertices]
        except (QhullError, ValueError):  # no, or too few, points, or all on a line
            continue
        ring = np.column_stack([corners, np.zeros(len(corners))])
        lines.append(np.stack([ring, np.roll(ring, -1, axis=0)], axis=1))
        owner.append(np.full(len(ring), number))
    return np.concatenate(lines), np.concatenate(owner)
