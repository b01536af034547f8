"""Where a mesh turns away from a camera: its contour, as segments on the mesh.

A point of view sees a face from the front or from behind; the contour consists of the edges between
the two kinds. All that a viewer sees as the outline of a mesh is contour, but not all contour is
seen: what stands before it hides it, see `line_drawing`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from burg_drake.core import Array, Indices, inverse, transform_points

CREASE = np.deg2rad(35.0)
"""Faces that meet at a larger angle than this make an edge that people see as one [rad]."""
CREASE_LENGTH = 0.02
"""Shorter edges of that kind are bumps of a scan [m]."""


@dataclass(frozen=True, eq=False)
class MeshContour:
    """Edges of a mesh at which it turns away from a point of view.

    Attributes:
        edges: (N,) indices into `MeshOutline.edges`.
        faces: (N,) a face at each that is seen from the front; for open edges the only one.
    """

    edges: Indices
    faces: Indices


class MeshOutline:
    """A mesh, prepared to tell its contour from any point of view.

    Closed surfaces wound outward have exact contours. The boundary of an open one counts as
    contour, as it does on a sheet. Where surfaces touch along an edge, each pair is told apart.

    Attributes:
        vertices: (V, 3) in the object frame O [m].
        faces: (F, 3) corners of the triangles that have an area.
        kept: (F,) which of the given faces these are.
        edges: (E, 2) vertices at the edges' ends; where more than two faces meet there is one for
            every pair of them.
        sides: (E, 2) faces at each edge; the second is -1 for an open one.
    """

    def __init__(self, vertices: Array, faces: Indices) -> None:
        """Prepares a mesh.

        Args:
            vertices: (V, 3) [m]; those that coincide must be merged.
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
        self.edges, self.sides = _edges(self.faces)
        self._bend = self._bends()
        self._open = self.sides[:, 1] < 0
        self._rim = np.flatnonzero(self._open)
        self._outward = ~self._open & (self._bend > 0.0)
        self._first, self._second = self.sides.T.copy()

    @property
    def normals(self) -> Array:
        """(F, 3) unit normals of the faces in O."""
        return self._planes[:, :3]

    def contour(self, p_OC: Array) -> MeshContour:
        """The contour from a point of view.

        Edges that the solid bends inwards at are left out: one of their faces hides them.

        Args:
            p_OC: (3,) point of view in O [m].
        """
        front = self.front(p_OC)
        turns = (front[self._first] != front[self._second]) & self._outward
        edges = np.flatnonzero(turns)
        first, second = self.sides[edges].T
        faces = np.where(front[first], first, second)
        return MeshContour(
            np.concatenate([edges, self._rim]), np.concatenate([faces, self._first[self._rim]])
        )

    def segments(self, X_CO: Array) -> Array:
        """(N, 2, 3) ends of the contour's edges in the camera's frame [m], hidden ones as well.

        Args:
            X_CO: (4, 4) object in the camera's frame.
        """
        contour = self.contour(inverse(X_CO)[:3, 3])
        return transform_points(X_CO, self.vertices[self.edges[contour.edges]])

    def front(self, p_OC: Array, faces: Indices | None = None) -> NDArray[np.bool_]:
        """Which faces a point of view in O sees from the front, if nothing is before them.

        Args:
            p_OC: (3,) [m].
            faces: indices of any shape, which is that of the result; all (F,) if None.
        """
        planes = self._planes if faces is None else self._planes[faces]
        return np.asarray(planes @ np.append(p_OC, 1.0) > 0.0)

    @cached_property
    def creases(self) -> Indices:
        """(N,) edges at which the surface bends outwards or inwards by more than `CREASE`, as far
        as they hang together over `CREASE_LENGTH`."""
        sharp = np.flatnonzero((np.abs(self._bend) > CREASE) & ~self._open)
        starts, ends = self.edges[sharp].T
        graph = coo_array((np.ones(len(sharp)), (starts, ends)), shape=(len(self.vertices),) * 2)
        _, group = connected_components(graph, directed=False)
        length = np.linalg.norm(self.vertices[ends] - self.vertices[starts], axis=1)
        whole = np.bincount(group[starts], length)
        return np.asarray(sharp[whole[group[starts]] > CREASE_LENGTH])

    def _bends(self) -> Array:
        """(E,) angle between the faces at an edge, positive where it sticks out [rad]."""
        first, second = self.normals[self.sides[:, 0]], self.normals[self.sides[:, 1]]
        across = np.linalg.norm(np.cross(first, second), axis=1)
        angle = np.arctan2(across, np.einsum("ij,ij->i", first, second))
        middle = self.vertices[self.faces].mean(axis=1)
        apart = middle[self.sides[:, 1]] - middle[self.sides[:, 0]]
        signed: Array = np.where(np.einsum("ij,ij->i", first, apart) <= 0.0, angle, -angle)
        return signed


def _edges(faces: Indices) -> tuple[Indices, Indices]:
    """Edges (E, 2) and the two faces at each (E, 2), -1 where there is no second."""
    pairs = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(faces)), 3)
    order = np.lexsort(pairs.T)
    pairs, owner = pairs[order], owner[order]
    new = np.ones(len(pairs) + 1, bool)
    new[1:-1] = (pairs[1:] != pairs[:-1]).any(axis=1)
    alone = new[:-1] & new[1:]
    joined = np.flatnonzero(~new[1:-1])  # this one and the next are of the same edge
    edges = np.concatenate([pairs[alone], pairs[joined]])
    single = np.column_stack([owner[alone], np.full(int(alone.sum()), -1)])
    double = np.column_stack([owner[joined], owner[joined + 1]])
    return edges, np.concatenate([single, double])
