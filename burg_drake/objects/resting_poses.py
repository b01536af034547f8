"""Finds stable poses on a horizontal plane, and the stable pose that an orientation belongs to.

Both follow from the height of the centre of mass over each facet of the convex hull.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from burg_drake.core import Array, Pose, make_pose
from burg_drake.geometry import convex_hull
from burg_drake.objects.library import StablePose
from burg_drake.objects.symmetry import Symmetries, SymmetrySearch

TILT_MARGIN = np.deg2rad(6.0)
"""Radians of tilt that a stable pose withstands without toppling."""


ROLL_MARGIN = np.deg2rad(10.0)
"""Radians of tilt whose height rise does not stop rolling: prisms with 18 or more sides roll."""


Index = NDArray[np.signedinteger]


@dataclass(frozen=True, eq=False)
class StableFacet:
    """A hull facet on which an object rests stably: a minimum of its potential landscape.

    Attributes:
        probability: share of random drops that end on the facet.
        down: (3,) unit vector of O that points down.
        height: centre of mass above the support [m].
    """

    probability: float
    down: Array
    height: float

    def rank(self) -> tuple[float, ...]:
        """Sort key: probability, highest first; among equally probable facets, such as mirror
        images, the lowest in the object's frame first, independent of the triangulation."""
        x, y, z = (float(v) for v in np.round(self.down, 4))
        return (-round(self.probability, 6), z, y, x)


@dataclass(frozen=True, eq=False)
class NeutralEquilibrium:
    """Directions of O between which an object rolls without rising much.

    Attributes:
        normals: (K, 3) normals of the facets that the object rolls over.
        arcs: (E, 2, 3) pairs of normals of facets that share an edge.
        corners: (C, 3) hull vertices about the centre of mass [m] that touch only facets that the
            object rolls over.
        points: (V, 3) all hull vertices about the centre of mass [m].
    """

    normals: Array
    arcs: Array
    corners: Array
    points: Array

    @property
    def max_angle(self) -> float:
        """Largest angle from the first normal [rad]."""
        return float(np.arccos(np.clip(self.normals @ self.normals[0], -1.0, 1.0)).max())

    def angle(self, down: Array) -> float:
        """Smallest angle from direction `down` (3,) of O to a direction that the object can roll
        to [rad]; 0 if `down` is one."""
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
            # on the arc: on the inner side of both ends
            inside = (np.einsum("ij,ij->i", np.cross(a, foot), across) > 0.0) & (
                np.einsum("ij,ij->i", np.cross(foot, b), across) > 0.0
            )
            if inside.any():
                near = max(near, float(np.linalg.norm(foot[inside], axis=1).max()))
        return float(np.arccos(np.clip(near, -1.0, 1.0)))


class PotentialLandscape:
    """Potential energy over orientation: the facets of the hull, and the passes between them.

    Args:
        support: (N, 3) points of O whose hull rests on the plane [m].
        p_OOcm: (3,) centre of mass, inside the hull [m].

    Attributes:
        points: (V, 3) vertices of the hull, about the centre of mass [m].
        normals: (F, 3) outward normals of the hull's triangles.
        heights: (F,) heights of the centre of mass above the facets [m].
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
        self._basins_by_margin: dict[float, Index] = {}

    def height(self, down: Array) -> Array:
        """Heights (...) of the centre of mass if directions `down` (..., 3) of O point down [m]."""
        return (down @ self.points.T).max(axis=-1)

    def minima(self, tilt_margin: float = TILT_MARGIN) -> list[StableFacet]:
        """Finds the facets on which the object rests stably, most probable first.

        Args:
            tilt_margin: minima separated by a smaller tilt are merged [rad].
        """
        face, successor = self._faces, self._toppled_faces
        share = np.bincount(face, weights=_solid_angles(self._triangles)) / (4.0 * np.pi)
        level = self._face_heights
        for i in np.argsort(-level, kind="stable"):
            if successor[i] != i:
                share[successor[i]] += share[i]
                share[i] = 0.0
        basin = self._basins(tilt_margin)[self._lowest_triangles]
        found = []
        for lowest in np.unique(basin):
            probability = float(share[basin == lowest].sum())
            if probability > 0.0:
                facet = StableFacet(probability, self.normals[lowest], float(self.heights[lowest]))
                found.append(facet)
        return sorted(found, key=StableFacet.rank)

    def minimum_below(self, down: Array) -> Array:
        """(3,) direction of the minimum that `down` (3,) leads to."""
        facet = int((self.normals @ down).argmax())
        return self.normals[self._basins(TILT_MARGIN)[facet]]

    def neutral_equilibrium(self, down: Array, margin: float = ROLL_MARGIN) -> NeutralEquilibrium:
        """Directions that the object can roll to from `down` (3,) while its height changes less
        than in a tilt by `margin` [rad]."""
        start = int((self.normals @ down).argmax())
        rows, other, passes = self._edge_passes
        level = self.heights[start]
        flat = passes * np.cos(margin) <= level
        low = self.heights < level * np.cos(margin)  # it would fall there and not return
        flat &= ~(low[rows] | low[other])
        count = len(self.heights)
        graph = coo_matrix((np.ones(flat.sum()), (rows[flat], other[flat])), (count, count))
        _, part = connected_components(graph, directed=False)
        within = part == part[start]
        edges = flat & within[rows]
        complete = np.ones(len(self._hull_points), dtype=bool)
        complete[self._corners[~within]] = False
        # rolling avoids vertices; those of a coarse sphere rise more than its edges
        complete &= np.linalg.norm(self._hull_points, axis=1) * np.cos(2.0 * margin) <= level
        used = np.unique(self._corners)
        return NeutralEquilibrium(
            np.vstack([self.normals[start], self.normals[within]]),
            np.stack([self.normals[rows[edges]], self.normals[other[edges]]], axis=1),
            self._hull_points[used[complete[used]]],
            self.points,
        )

    def rolls(self, down: Array) -> bool:
        """Whether the object can roll by 60 degrees from direction `down` (3,)."""
        # Radians; an object rolls if it can turn this far without a higher pass.
        min_span = np.deg2rad(60.0)
        return bool(self.neutral_equilibrium(down).max_angle >= min_span)

    @cached_property
    def _faces(self) -> Index:
        """(F,) face number of each triangle."""
        coplanar_angle = 1e-3  # Radians between facets of one face; vertices in files are rounded.
        count = len(self.heights)
        rows, k = np.nonzero(np.arange(count)[:, None] < self._neighbors)
        other = self._neighbors[rows, k]
        bend = np.linalg.norm(self.normals[rows] - self.normals[other], axis=1)
        same = bend < coplanar_angle
        graph = coo_matrix((np.ones(same.sum()), (rows[same], other[same])), (count, count))
        return connected_components(graph, directed=False)[1]

    @cached_property
    def _lowest_triangles(self) -> Index:
        """(faces,) the lowest triangle of each face."""
        order = np.lexsort((self.heights, self._faces))
        _, at = np.unique(self._faces[order], return_index=True)
        return order[at]

    @cached_property
    def _face_heights(self) -> Array:
        """(faces,) mean height of each face."""
        count = np.bincount(self._faces)
        return np.bincount(self._faces, weights=self.heights) / count

    @cached_property
    def _toppled_faces(self) -> Index:
        """(faces,) the face that each face topples to; itself if the centre of mass is above it."""
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
        worst = order[at]  # the triangle of each face with the farthest-passed edge
        towards = to[worst, k[worst]]
        falls = (beyond[worst, k[worst]] > 0.0) & (self._face_heights[towards] < self._face_heights)
        return np.where(falls, towards, np.arange(len(worst)))

    @cached_property
    def _edge_passes(self) -> tuple[Index, Index, Array]:
        """Edges between facets: the two facets (E,), and the height of the centre of mass when it
        passes over the edge (E,) [m]."""
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
        """(F,) the lowest facet of each facet's basin; basins separated by a small tilt are merged.

        Edges are processed by the height of their pass. A pass joins two basins if it is less than
        the tilt margin above the higher of their minima.
        """
        if tilt_margin in self._basins_by_margin:
            return self._basins_by_margin[tilt_margin]
        rows, other, passes = self._edge_passes
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
        self._basins_by_margin[tilt_margin] = np.array([low[root(i)] for i in range(len(heights))])
        return self._basins_by_margin[tilt_margin]


def _solid_angles(triangles: Array) -> Array:
    """(F,) solid angles seen from the origin (van Oosterom and Strackee, 1983)."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    det = np.abs(np.einsum("ij,ij->i", a, np.cross(b, c)))
    dot = [np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a))]
    return 2.0 * np.arctan2(det, la * lb * lc + dot[0] * lc + dot[1] * la + dot[2] * lb)


def stable_poses(
    surface: trimesh.Trimesh, support: Array, p_OOcm: Array, search: SymmetrySearch | None = None
) -> tuple[StablePose, ...]:
    """Finds the stable poses of an object, most probable first.

    Args:
        surface: surface in O [m]; determines which poses are equal by symmetry.
        support: (N, 3) points of O whose hull rests on the plane [m].
        p_OOcm: (3,) centre of mass [m].
        search: symmetry search of the surface about `p_OOcm`, if available; made if None.

    Returns:
        At least one pose; probabilities sum to one.
    """
    min_probability = 0.01  # Rarer poses are left out; the others are scaled to a sum of 1.
    landscape = PotentialLandscape(support, p_OOcm)
    classes = _merge_symmetric_poses(landscape, search or SymmetrySearch(surface, p_OOcm))
    highest = max(c.probability for c in classes)
    kept = [c for c in classes if c.probability >= min(min_probability, highest)]
    total = sum(c.probability for c in kept)
    kept.sort(key=StableFacet.rank)
    return tuple(
        StablePose(
            probability=round(c.probability / total, 6),
            X_SO=Pose.from_matrix(resting_pose(c.down, c.height, p_OOcm), quaternion=True),
            rolls=landscape.rolls(c.down),
        )
        for c in kept
    )


def resting_pose(down: Array, height: float, p_OOcm: Array) -> Array:
    """`X_SO` (4, 4) that turns `down` (3,) of O downwards by the shortest rotation, with the centre
    of mass `height` [m] above the origin of S."""
    R_SO = _shortest_rotation(down, np.array([0.0, 0.0, -1.0]))
    return make_pose(R_SO, np.array([0.0, 0.0, height]) - R_SO @ p_OOcm)


def _merge_symmetric_poses(
    landscape: PotentialLandscape, search: SymmetrySearch
) -> list[StableFacet]:
    facets = landscape.minima()
    heights = np.sort([facet.height for facet in facets])
    if not (np.diff(heights) <= search.tolerance).any():
        return facets
    symmetries = search.find()
    classes: list[list[StableFacet]] = []
    for facet in facets:
        alike = [
            c
            for c in classes
            if any(
                abs(facet.height - known.height) <= search.tolerance
                and is_symmetric_minimum(landscape, symmetries, facet.down, known.down)
                for known in c
            )
        ]
        classes = [c for c in classes if not any(c is a for a in alike)]
        classes.append(
            sorted([*(known for c in alike for known in c), facet], key=StableFacet.rank)
        )
    return [StableFacet(sum(f.probability for f in c), c[0].down, c[0].height) for c in classes]


def is_symmetric_minimum(
    landscape: PotentialLandscape, symmetries: Symmetries, a: Array, b: Array
) -> bool:
    """Whether a symmetry takes direction a (3,) to the minimum of the landscape that b (3,) belongs
    to. Several facets can belong to one minimum; b is the normal of one.
    """
    return any(
        float(landscape.minimum_below(image) @ b) > np.cos(TILT_MARGIN)
        for image in symmetries.images(a, b)
    )


def _shortest_rotation(a: Array, b: Array) -> Array:
    """(3, 3) shortest rotation that takes unit vector a to unit vector b (about x if they are
    opposite)."""
    v, c = np.cross(a, b), float(a @ b)
    if c < -1.0 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    K = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + K + K @ K / (1.0 + c)


class PoseClasses:
    """Classifies the orientation of an object that has come to rest as one of its stable poses.

    An orientation belongs to a pose if it is near the pose, if the object can roll from it to the
    pose, if it is in the basin of the pose and not much higher, or if the pose is equal to such a
    pose by symmetry.

    Args:
        poses: the stable poses.
        landscape: potential landscape of the object.
        search: makes the search for symmetries of the surface about the centre of mass; called
            only if needed.

    Attributes:
        downs: for each pose the unit vector (3,) of O that points down.
    """

    def __init__(
        self,
        poses: Sequence[StablePose],
        landscape: PotentialLandscape,
        search: Callable[[], SymmetrySearch],
    ) -> None:
        self.poses, self.landscape = tuple(poses), landscape
        self.downs = [-pose.X_SO.matrix()[2, :3] for pose in poses]
        self._make_search = search
        self._neutral: dict[int, NeutralEquilibrium] = {}

    def angle(self, k: int, down: Array) -> float:
        """Angle from pose k to direction `down` (3,), not counting rolling [rad]."""
        turn = angle_between(self.downs[k], down)
        if self.poses[k].rolls:
            if k not in self._neutral:
                self._neutral[k] = self.landscape.neutral_equilibrium(self.downs[k])
            turn = min(turn, self._neutral[k].angle(down))
        return turn

    def find(self, down: Array) -> tuple[int, float] | None:
        """Finds the stable pose of an object with `down` (3,) pointing down.

        Returns:
            Number of the pose, and the angle from it up to symmetry [rad]; None if no pose matches.
        """
        near_angle = TILT_MARGIN  # Radians; orientations closer to a pose belong to it.
        same_angle = np.deg2rad(0.5)  # Radians between directions that differ by rounding.
        angles = [self.angle(k, down) for k in range(len(self.poses))]
        k = int(np.argmin(angles))
        if angles[k] <= near_angle:
            return k, angles[k]
        lowest = self.landscape.minimum_below(down)
        level = float(self.landscape.height(lowest))
        height = float(self.landscape.height(down))
        if angle_between(lowest, down) > near_angle and height * np.cos(ROLL_MARGIN) > level:
            return None
        for k in np.argsort([angle_between(known, lowest) for known in self.downs]).tolist():
            if angle_between(self.downs[k], lowest) < same_angle:
                return k, angles[k]
            height_difference = abs(level - float(self.landscape.height(self.downs[k])))
            if height_difference > self._search.tolerance:
                continue
            if is_symmetric_minimum(self.landscape, self._search.find(), lowest, self.downs[k]):
                return k, angle_between(lowest, down)
        return None

    @cached_property
    def _search(self) -> SymmetrySearch:
        return self._make_search()


def angle_between(a: Array, b: Array) -> float:
    """Angle between unit vectors (3,), accurate for small angles [rad]."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
