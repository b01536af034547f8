"""How an object comes to rest on a horizontal plane, and how often.

Quasi-static, after Goldberg, Mirtich, Zhuang, Craig, Carlisle and Canny, "Part Pose Statistics"
(IEEE T-RA 15(5), 1999): an object dropped with a random orientation lands on the hull facet that
the vertical through its centre of mass meets, then topples from facet to facet while that lowers
the centre of mass. The height of the centre of mass over the facet that is down is a landscape
whose minima are the stable poses. Two minima are one pose

- when a tilt of a few degrees leads from one to the other (facets of a rolling surface, dents of a
  scan), and
- when a turn of the object onto itself takes one to the other (the ends of a plain cylinder).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

from burg_drake.core.frames import Array, make_pose
from burg_drake.core.schema import Pose
from burg_drake.objects.hulls import convex_hull
from burg_drake.objects.library import StablePose
from burg_drake.objects.symmetry import SymmetryTest

TILT_MARGIN = np.deg2rad(6.0)
"""Poses that topple when tilted by less than this are not counted as poses of their own [rad]."""

MIN_PROBABILITY = 0.01
"""Rarer poses are left out, and the others scaled to a sum of one."""


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


def stable_poses(surface: trimesh.Trimesh, support: Array, p_OOcm: Array) -> tuple[StablePose, ...]:
    """Resting poses, most probable first.

    Args:
        surface: in O [m]; tells which poses are the same by symmetry.
        support: (N, 3) points of O whose hull rests on the plane [m].
        p_OOcm: (3,) centre of mass [m].

    Returns:
        At least one pose; probabilities sum to one.
    """
    facets = resting_facets(support, p_OOcm)
    classes = _merge_symmetric(facets, surface, p_OOcm)
    most = max(c.probability for c in classes)
    kept = [c for c in classes if c.probability >= min(MIN_PROBABILITY, most)]
    total = sum(c.probability for c in kept)
    kept.sort(key=lambda c: -c.probability)
    return tuple(
        StablePose(
            probability=round(c.probability / total, 6),
            X_SO=Pose.from_matrix(resting_pose(c.down, c.height, p_OOcm), quaternion=True),
        )
        for c in kept
    )


def resting_pose(down: Array, height: float, p_OOcm: Array) -> Array:
    """`X_SO` (4, 4) with `down` (3,) of O pointing down by the shortest turn, and the centre of
    mass `height` [m] above the origin of S."""
    R_SO = _shortest_rotation(down, np.array([0.0, 0.0, -1.0]))
    return make_pose(R_SO, np.array([0.0, 0.0, height]) - R_SO @ p_OOcm)


def resting_facets(
    support: Array, p_OOcm: Array, tilt_margin: float = TILT_MARGIN
) -> list[RestingFacet]:
    """Minima of the landscape with their probabilities, before any symmetry is looked for.

    Args:
        support: (N, 3) points whose hull rests on the plane [m].
        p_OOcm: (3,) centre of mass, inside the hull [m].
        tilt_margin: minima parted by a smaller tilt are one [rad].
    """
    hull = convex_hull(support - p_OOcm)
    triangles, normals = hull.points[hull.simplices], hull.equations[:, :3]
    heights = -hull.equations[:, 3]
    share = _solid_angles(triangles) / (4.0 * np.pi)
    successor = _topple(triangles, normals, heights, hull.neighbors)
    for face in np.argsort(-heights, kind="stable"):
        if successor[face] != face:
            share[successor[face]] += share[face]
            share[face] = 0.0
    basin = _basins(triangles, normals, heights, hull.neighbors, tilt_margin)
    found = []
    for lowest in np.unique(basin):
        probability = float(share[basin == lowest].sum())
        if probability > 0.0:
            found.append(RestingFacet(probability, normals[lowest], float(heights[lowest])))
    return sorted(found, key=lambda f: -f.probability)


def _solid_angles(triangles: Array) -> Array:
    """(F,) solid angles seen from the origin (van Oosterom and Strackee, 1983)."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    det = np.abs(np.einsum("ij,ij->i", a, np.cross(b, c)))
    dot = [np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a))]
    return 2.0 * np.arctan2(det, la * lb * lc + dot[0] * lc + dot[1] * la + dot[2] * lb)


def _topple(
    triangles: Array, normals: Array, heights: Array, neighbors: NDArray[np.int32]
) -> NDArray[np.int64]:
    """(F,) the facet that each facet topples to, itself where the centre of mass is above it."""
    foot = normals * heights[:, None]
    beyond = np.empty(neighbors.shape)
    for k in range(3):  # neighbour k lies across the edge opposite to corner k
        a, b = triangles[:, (k + 1) % 3], triangles[:, (k + 2) % 3]
        outward = np.cross(b - a, normals)
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        side = np.sign(np.einsum("ij,ij->i", outward, a - triangles[:, k]))
        beyond[:, k] = side * np.einsum("ij,ij->i", outward, foot - a)
    worst = beyond.argmax(axis=1)
    rows = np.arange(len(triangles))
    to = neighbors[rows, worst]
    falls = (beyond[rows, worst] > 0.0) & (heights[to] < heights)
    return np.where(falls, to, rows)


def _basins(
    triangles: Array,
    normals: Array,
    heights: Array,
    neighbors: NDArray[np.int32],
    tilt_margin: float,
) -> NDArray[np.int64]:
    """(F,) the lowest facet of each facet's basin; basins parted by a small tilt are one.

    Edges are taken by the height of the pass over them. A pass joins two basins when, from the
    higher one's minimum, it is less than the tilt margin up.
    """
    rows, k = np.nonzero(np.arange(len(heights))[:, None] < neighbors)
    other = neighbors[rows, k]
    a, b = triangles[rows, (k + 1) % 3], triangles[rows, (k + 2) % 3]
    along = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    arm = a - np.einsum("ij,ij->i", a, along)[:, None] * along
    reach = np.linalg.norm(arm, axis=1)
    between = np.einsum("ij,ij->i", np.cross(normals[rows], arm), np.cross(arm, normals[other])) > 0
    higher = np.maximum(heights[rows], heights[other])
    passes = np.where(between, np.maximum(reach, higher), higher)
    parent = np.arange(len(heights))
    low = np.arange(len(heights))  # lowest facet of each root's basin

    def root(i: int) -> int:
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    for e in np.argsort(passes, kind="stable"):
        i, j = root(rows[e]), root(other[e])
        if i == j:
            continue
        if heights[low[i]] > heights[low[j]]:
            i, j = j, i
        if heights[low[j]] >= passes[e] * np.cos(tilt_margin):
            parent[j] = i
    return np.array([low[root(i)] for i in range(len(heights))])


def _merge_symmetric(
    facets: Sequence[RestingFacet], surface: trimesh.Trimesh, p_OOcm: Array
) -> list[RestingFacet]:
    if len(facets) < 2:
        return list(facets)
    test = SymmetryTest(surface, p_OOcm)
    classes: list[list[RestingFacet]] = []
    for facet in facets:
        alike = [c for c in classes if any(_same(test, facet, known) for known in c)]
        classes = [c for c in classes if not any(c is a for a in alike)]
        classes.append(sorted([*(known for c in alike for known in c), facet], key=_rarity))
    return [RestingFacet(sum(f.probability for f in c), c[0].down, c[0].height) for c in classes]


def _rarity(facet: RestingFacet) -> float:
    return -facet.probability


def _same(test: SymmetryTest, a: RestingFacet, b: RestingFacet) -> bool:
    return abs(a.height - b.height) < test.tolerance and test.same(a.down, b.down)


def _shortest_rotation(a: Array, b: Array) -> Array:
    """(3, 3) rotation that takes unit vector a to unit vector b by the shortest turn (about x where
    they are opposite)."""
    v, c = np.cross(a, b), float(a @ b)
    if c < -1.0 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    K = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + K + K @ K / (1.0 + c)
