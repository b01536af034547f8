"""The height of an object's centre of mass over every facet of its hull that can be down.

After Goldberg, Mirtich, Zhuang, Craig, Carlisle and Canny, "Part Pose Statistics" (IEEE T-RA
15(5), 1999): an object dropped with a random orientation lands on the facet that the vertical
through its centre of mass meets, then topples from facet to facet while that lowers the centre of
mass. The minima of this landscape are the ways to rest; where it is flat, the object rolls.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from burg_drake.core import Array
from burg_drake.geometry import convex_hull

TILT_MARGIN = np.deg2rad(6.0)
"""Minima that topple when tilted by less than this are not counted as such [rad]."""

COPLANAR = 1e-3
"""Facets that meet at a smaller angle are one face, however it is cut into triangles [rad]. Files
with vertices rounded to 0.1 um bend a face of millimetres by a tenth of it."""

ROLL_MARGIN = np.deg2rad(10.0)
"""Rising by as much as in a tilt by this, or falling by it, keeps nothing from rolling on [rad]: a
prism rolls with 18 sides and more."""

ROLL_SPAN = np.deg2rad(60.0)
"""What can turn by this much without a higher pass rolls [rad]."""

Index = NDArray[np.signedinteger]


@dataclass(frozen=True, eq=False)
class RestingFacet:
    """A minimum of the landscape.

    Attributes:
        probability: share of random drops that end here.
        down: (3,) unit vector of O that points down.
        height: centre of mass above the support [m].
    """

    probability: float
    down: Array
    height: float

    def rank(self) -> tuple[float, ...]:
        """Sorts by probability; of mirror images and the like, the one that is down as the object
        stands in its frame comes first, however the surface is cut into triangles."""
        x, y, z = (float(v) for v in np.round(self.down, 4))
        return (-round(self.probability, 6), z, y, x)


@dataclass(frozen=True, eq=False)
class NeutralEquilibrium:
    """Directions of O between which an object rolls without rising much.

    Attributes:
        normals: (K, 3) facets that can be down on the way.
        arcs: (E, 2, 3) pairs of them that share an edge.
        corners: (C, 3) hull vertices about the centre of mass [m] that it can stand on on the way;
            all their facets are among these.
        points: (V, 3) all hull vertices about the centre of mass [m].
    """

    normals: Array
    arcs: Array
    corners: Array
    points: Array

    @property
    def span(self) -> float:
        """Largest turn away from the first normal [rad]."""
        return float(np.arccos(np.clip(self.normals @ self.normals[0], -1.0, 1.0)).max())

    def angle(self, down: Array) -> float:
        """From direction `down` (3,) of O to the nearest of these [rad]; 0 among them."""
        lowest = self.points[(self.points @ down).argmax()]
        if len(self.corners) and (np.linalg.norm(self.corners - lowest, axis=1) < 1e-12).any():
            return 0.0
        near = float((self.normals @ down).max())
        if len(self.arcs):
            a, b = self.arcs[:, 0], self.arcs[:, 1]
            across = np.cross(a, b)
            length = np.linalg.norm(across, axis=1)
            turns = length > 1e-9
            a, b, across = a[turns], b[turns], across[turns] / length[turns, None]
            foot = down - (across @ down)[:, None] * across
            # on the arc: on its inner side as seen from either end
            inside = (np.einsum("ij,ij->i", np.cross(a, foot), across) > 0.0) & (
                np.einsum("ij,ij->i", np.cross(foot, b), across) > 0.0
            )
            if inside.any():
                near = max(near, float(np.linalg.norm(foot[inside], axis=1).max()))
        return float(np.arccos(np.clip(near, -1.0, 1.0)))


class PotentialLandscape:
    """Facets of the hull, what they topple to and what lies between them.

    Args:
        support: (N, 3) points of O whose hull rests on the plane [m].
        p_OOcm: (3,) centre of mass, inside the hull [m].

    Attributes:
        points: (V, 3) of the hull, about the centre of mass [m].
        normals: (F, 3) outward, of the hull's triangles.
        heights: (F,) of the centre of mass over them [m].
    """

    def __init__(self, support: Array, p_OOcm: Array) -> None:
        hull = convex_hull(support - p_OOcm)
        self.points = hull.points[np.sort(hull.vertices)]
        self.normals = hull.equations[:, :3]
        self.heights = -hull.equations[:, 3]
        self._corners = hull.simplices
        self._neighbors = hull.neighbors.astype(int)
        self._triangles = hull.points[hull.simplices]
        self._hull_points = hull.points
        self._found: dict[float, Index] = {}

    def height(self, down: Array) -> Array:
        """Of the centre of mass with directions `down` (..., 3) of O down, (...) [m]."""
        return (down @ self.points.T).max(axis=-1)

    def minima(self, tilt_margin: float = TILT_MARGIN) -> list[RestingFacet]:
        """Ways to rest, most probable first.

        Args:
            tilt_margin: minima parted by a smaller tilt are one [rad].
        """
        face, successor = self._faces, self._toppled
        share = np.bincount(face, weights=_solid_angles(self._triangles)) / (4.0 * np.pi)
        level = self._levels
        for i in np.argsort(-level, kind="stable"):
            if successor[i] != i:
                share[successor[i]] += share[i]
                share[i] = 0.0
        basin = self._basins(tilt_margin)[self._first]
        found = []
        for lowest in np.unique(basin):
            probability = float(share[basin == lowest].sum())
            if probability > 0.0:
                facet = RestingFacet(probability, self.normals[lowest], float(self.heights[lowest]))
                found.append(facet)
        return sorted(found, key=RestingFacet.rank)

    def basin(self, down: Array) -> Array:
        """(3,) direction of the minimum that `down` (3,) leads to."""
        facet = int((self.normals @ down).argmax())
        return self.normals[self._basins(TILT_MARGIN)[facet]]

    def neutral(self, down: Array, margin: float = ROLL_MARGIN) -> NeutralEquilibrium:
        """Where it rolls from direction `down` (3,), rising and falling by less than a tilt by
        `margin` would do."""
        start = int((self.normals @ down).argmax())
        rows, other, passes = self._passes
        level = self.heights[start]
        flat = passes * np.cos(margin) <= level
        low = self.heights < level * np.cos(margin)  # it would fall there, and not come back
        flat &= ~(low[rows] | low[other])
        count = len(self.heights)
        graph = coo_matrix((np.ones(flat.sum()), (rows[flat], other[flat])), (count, count))
        _, part = connected_components(graph, directed=False)
        within = part == part[start]
        edges = flat & within[rows]
        complete = np.ones(len(self._hull_points), dtype=bool)
        complete[self._corners[~within]] = False
        # tips are not passed; the corners of a sphere of few faces rise more than its edges
        complete &= np.linalg.norm(self._hull_points, axis=1) * np.cos(2.0 * margin) <= level
        used = np.unique(self._corners)
        return NeutralEquilibrium(
            np.vstack([self.normals[start], self.normals[within]]),
            np.stack([self.normals[rows[edges]], self.normals[other[edges]]], axis=1),
            self._hull_points[used[complete[used]]],
            self.points,
        )

    def rolls(self, down: Array) -> bool:
        """Whether it can roll on from `down` (3,) by `ROLL_SPAN`."""
        return bool(self.neutral(down).span >= ROLL_SPAN)

    @cached_property
    def _faces(self) -> Index:
        """(F,) number of the face that each triangle belongs to."""
        count = len(self.heights)
        rows, k = np.nonzero(np.arange(count)[:, None] < self._neighbors)
        other = self._neighbors[rows, k]
        bend = np.linalg.norm(self.normals[rows] - self.normals[other], axis=1)
        same = bend < COPLANAR
        graph = coo_matrix((np.ones(same.sum()), (rows[same], other[same])), (count, count))
        return connected_components(graph, directed=False)[1]

    @cached_property
    def _first(self) -> Index:
        """(faces,) the lowest triangle of each face."""
        order = np.lexsort((self.heights, self._faces))
        _, at = np.unique(self._faces[order], return_index=True)
        return order[at]

    @cached_property
    def _levels(self) -> Array:
        """(faces,) mean height of each face."""
        count = np.bincount(self._faces)
        return np.bincount(self._faces, weights=self.heights) / count

    @cached_property
    def _toppled(self) -> Index:
        """(faces,) the face that each face topples to, itself where the centre of mass is above
        it."""
        foot = self.normals * self.heights[:, None]
        beyond = np.empty(self._neighbors.shape)
        for k in range(3):  # neighbour k lies across the edge opposite to corner k
            a, b = self._triangles[:, (k + 1) % 3], self._triangles[:, (k + 2) % 3]
            outward = np.cross(b - a, self.normals)
            outward /= np.linalg.norm(outward, axis=1, keepdims=True)
            inward = np.einsum("ij,ij->i", outward, a - self._triangles[:, k])
            beyond[:, k] = np.sign(inward) * np.einsum("ij,ij->i", outward, foot - a)
        face, to = self._faces, self._faces[self._neighbors]
        beyond[to == face[:, None]] = -np.inf
        k = beyond.argmax(axis=1)
        rows = np.arange(len(face))
        order = np.lexsort((-beyond[rows, k], face))
        _, at = np.unique(face[order], return_index=True)
        worst = order[at]  # the triangle of each face with the edge that is passed the farthest
        towards = to[worst, k[worst]]
        falls = (beyond[worst, k[worst]] > 0.0) & (self._levels[towards] < self._levels)
        return np.where(falls, towards, np.arange(len(worst)))

    @cached_property
    def _passes(self) -> tuple[Index, Index, Array]:
        """Edges between facets: one facet, the other facet (E,) and the height of the centre of
        mass when it passes over the edge (E,) [m]."""
        rows, k = np.nonzero(np.arange(len(self.heights))[:, None] < self._neighbors)
        other = self._neighbors[rows, k]
        a, b = self._triangles[rows, (k + 1) % 3], self._triangles[rows, (k + 2) % 3]
        along = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
        arm = a - np.einsum("ij,ij->i", a, along)[:, None] * along
        turn = np.cross(self.normals[rows], arm), np.cross(arm, self.normals[other])
        between = np.einsum("ij,ij->i", *turn) > 0.0
        higher = np.maximum(self.heights[rows], self.heights[other])
        reach = np.linalg.norm(arm, axis=1)
        return rows, other, np.where(between, np.maximum(reach, higher), higher)

    def _basins(self, tilt_margin: float) -> Index:
        """(F,) the lowest facet of each facet's basin; basins parted by a small tilt are one.

        Edges are taken by the height of the pass over them. A pass joins two basins when, from the
        higher one's minimum, it is less than the tilt margin up.
        """
        if tilt_margin in self._found:
            return self._found[tilt_margin]
        rows, other, passes = self._passes
        heights = self.heights.tolist()
        parent = list(range(len(heights)))
        low = list(range(len(heights)))  # lowest facet of each root's basin

        def root(i: int) -> int:
            while parent[i] != i:
                parent[i] = parent[parent[i]]
                i = parent[i]
            return i

        order = np.argsort(passes, kind="stable")
        limit = passes * np.cos(tilt_margin)
        for r, o, most in zip(*(v[order].tolist() for v in (rows, other, limit)), strict=True):
            i, j = root(r), root(o)
            if i == j:
                continue
            if heights[low[i]] > heights[low[j]]:
                i, j = j, i
            if heights[low[j]] >= most:
                parent[j] = i
        self._found[tilt_margin] = np.array([low[root(i)] for i in range(len(heights))])
        return self._found[tilt_margin]


def _solid_angles(triangles: Array) -> Array:
    """(F,) solid angles seen from the origin (van Oosterom and Strackee, 1983)."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    det = np.abs(np.einsum("ij,ij->i", a, np.cross(b, c)))
    dot = [np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a))]
    return 2.0 * np.arctan2(det, la * lb * lc + dot[0] * lc + dot[1] * la + dot[2] * lb)
