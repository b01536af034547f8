"""What a depth image tells about the scene, and how the scene looks along a direction of approach.

An `ApproachView` is a height map seen by a hand that comes straight along its approach. A hand is
clear of the scene, on the whole way, if no height below its parts is above them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.sparse.csgraph import connected_components

from burg_drake.benchmark.burg_planner import Observation
from burg_drake.core import Array, Booleans, Indices, Single, inverse, transform_points

Floats = NDArray[np.floating[Any]]
"""Numbers of single or double precision."""
CELL_SIZE = 0.002
"""Size of a cell of a height map [m]."""
MAX_OVERHANG = 0.15
"""Distance around the bounds of the objects within which the hand may meet something [m]."""
MIN_HEIGHT = 0.008
"""Points that are lower above the table may be the table, measured with noise [m]."""
MAX_PIXEL_STEPS = 5.0
"""Largest difference in depth between neighbouring pixels of one surface, in units of the distance
between their points on a surface that faces the camera."""


EDGE_PIXELS = 5
"""Width of the strip beside an edge in which depth is a mixture of both sides [pixels]."""


@dataclass(frozen=True, eq=False)
class SceneCloud:
    """Points of a depth image in the scene frame, without those of the table.

    Attributes:
        p_SP: (N, 3) measured points [m].
        cluster: (N,) number of the connected surface of each point; -1 for points that are not to
            be grasped, such as those outside the bounds of the objects.
        p_SH: (M, 3) points where the camera's rays enter space that it does not see [m].
        p_ST: (K, 3) for each cluster, the middle of its visible volume above the table [m].
    """

    p_SP: Array
    cluster: Indices
    p_SH: Array
    p_ST: Array

    @classmethod
    def of(cls, observation: Observation) -> SceneCloud:
        """The points of an observation, smoothed, and denser than its pixels."""
        depth, measured = fill_depth(observation.depth)
        step = MAX_PIXEL_STEPS * depth / float(observation.K[0, 0])
        depth = smooth_depth(depth, step)
        X_SC = inverse(observation.X_CS)
        p_SP = transform_points(X_SC, _points_at(depth, observation.K, *_pixels(depth)))
        low, high = np.asarray(observation.bounds, dtype=float)
        near = (p_SP > low - MAX_OVERHANG) & (p_SP < high + MAX_OVERHANG)
        solid = near.all(axis=-1) & (p_SP[..., 2] > MIN_HEIGHT) & measured
        inside = solid & ((p_SP > low) & (p_SP < high)).all(axis=-1)
        beside_fixed = ndimage.binary_dilation(solid & ~inside, iterations=EDGE_PIXELS)
        if observation.target is not None and observation.segmentation is not None:
            inside &= observation.segmentation == observation.target
        label = _label_surfaces(depth, inside, step, beside_fixed)
        rows = np.flatnonzero(ndimage.binary_dilation(near.all(axis=-1)).any(axis=1))
        if not len(rows):
            empty = np.empty((0, 3))
            return cls(empty, np.empty(0, dtype=np.intp), empty, empty)
        cut = slice(rows[0], rows[-1] + 1)
        pixel, value, nearest = _refine(depth, solid, step, cut)
        dense = transform_points(X_SC, _points_at(value, observation.K, *pixel))
        hidden = transform_points(X_SC, _hidden_points(depth, observation.K, step, cut))
        hidden = hidden[((hidden > low - MAX_OVERHANG) & (hidden < high + MAX_OVERHANG)).all(-1)]
        cluster = label[nearest]
        return cls(dense, cluster, hidden, _middles(dense, cluster))


def fill_depth(depth: Array) -> tuple[Array, Booleans]:
    """Smoothed depth without holes: (H, W) depth [m], and (H, W) whether it was measured.

    Stereo cameras lose the background beside an object, so that a hole gets the larger one of the
    depths at its left and right end.
    """
    measured = np.asarray(depth) > 0.0
    columns = np.arange(depth.shape[1])
    left = np.maximum.accumulate(np.where(measured, columns, -1), axis=1)
    right = np.minimum.accumulate(np.where(measured, columns, len(columns))[:, ::-1], axis=1)
    padded = np.pad(np.asarray(depth, dtype=np.float64), ((0, 0), (1, 1)))
    rows = np.arange(len(depth))[:, None]
    filled = np.maximum(padded[rows, left + 1], padded[rows, right[:, ::-1] + 1])
    return ndimage.median_filter(filled, 3), measured


def smooth_depth(depth: Array, step: Array) -> Array:
    """(H, W) depth averaged over neighbouring pixels whose depth differs by less than `step`."""
    padded = np.pad(depth, 2, mode="edge")
    height, width = depth.shape
    total, count = np.zeros_like(depth), np.zeros_like(depth)
    for row in range(5):
        for column in range(5):
            difference = padded[row : row + height, column : column + width] - depth
            near = np.abs(difference) < step
            total += difference * near
            count += near
    return np.asarray(depth + total / np.maximum(count, 1.0))


def _pixels(depth: Array) -> tuple[Array, Array]:
    """Columns (1, W) and rows (H, 1) of an image."""
    return np.arange(float(depth.shape[1]))[None], np.arange(float(depth.shape[0]))[:, None]


def _points_at(depth: Floats, K: Array, column: Floats, row: Floats) -> Array:
    """(..., 3) points in the camera's frame at pixels with a depth (...)."""
    x = (column - K[0, 2]) / K[0, 0] * depth
    y = (row - K[1, 2]) / K[1, 1] * depth
    return np.stack([x, y, depth], axis=-1)


def _label_surfaces(depth: Array, chosen: Booleans, step: Array, beside_fixed: Booleans) -> Indices:
    """(H, W) number of the surface of each chosen pixel, -1 for the others.

    Neighbouring pixels are on one surface if their depths differ by less than `step` (H, W).
    Surfaces of a few pixels are left out, and those with most pixels in `beside_fixed` (H, W): they
    are edges of walls and shelves, measured with noise.
    """
    min_pixels = 30
    label = np.full(depth.shape, -1, dtype=np.intp)
    number = np.cumsum(chosen.ravel()).reshape(depth.shape) - 1
    links = []
    for a, b in (
        (np.s_[:, :-1], np.s_[:, 1:]),
        (np.s_[:-1], np.s_[1:]),
        (np.s_[:-1, :-1], np.s_[1:, 1:]),
        (np.s_[1:, :-1], np.s_[:-1, 1:]),
    ):
        joined = chosen[a] & chosen[b] & (np.abs(depth[a] - depth[b]) < step[a])
        links.append(np.stack([number[a][joined], number[b][joined]]))
    i, j = np.concatenate(links, axis=1)
    n = int(chosen.sum())
    count, found = connected_components(sparse.coo_array((np.ones(len(i)), (i, j)), (n, n)), False)
    size = np.bincount(found, minlength=count)
    fixed = np.bincount(found[beside_fixed[chosen]], minlength=count) > 0.5 * size
    kept = (size >= min_pixels) & ~fixed
    renamed = np.where(kept, np.cumsum(kept) - 1, -1)
    label[chosen] = renamed[found]
    return label


def _refine(
    depth: Array, solid: Booleans, step: Array, rows: slice
) -> tuple[tuple[Array, Array], Array, tuple[Indices, Indices]]:
    """Solid pixels and, within surfaces, positions between them about `CELL_SIZE / 2` apart.

    Returns:
        Columns and rows (N,) of the positions, their depth (N,), and their nearest pixels as an
        index of the image.
    """
    d, s = depth[rows], solid[rows]
    four = np.stack([d[:-1, :-1], d[:-1, 1:], d[1:, :-1], d[1:, 1:]])
    smooth = np.ptp(four, axis=0) < 2.0 * step[rows][:-1, :-1]
    whole = s[:-1, :-1] & s[:-1, 1:] & s[1:, :-1] & s[1:, 1:]
    r, c = np.nonzero(smooth & whole)
    corners = four[:, r, c]
    distance = float(np.median(step[rows][s])) / MAX_PIXEL_STEPS if s.any() else CELL_SIZE
    parts = int(np.clip(np.ceil(2.0 * distance / CELL_SIZE), 1, 4))
    found = [(np.nonzero(s)[1].astype(float), np.nonzero(s)[0].astype(float), d[s])]
    for i in range(parts):
        for j in range(parts):
            if i == j == 0:
                continue
            y, x = i / parts, j / parts
            weights = np.array([(1 - y) * (1 - x), (1 - y) * x, y * (1 - x), y * x])
            found.append((c + x, r + y, weights @ corners))
    column, row, value = (np.concatenate(part) for part in zip(*found, strict=True))
    row = row + (rows.start or 0)
    nearest = (np.rint(row).astype(np.intp), np.rint(column).astype(np.intp))
    return (column, row), value, nearest


def _hidden_points(depth: Array, K: Array, step: Array, rows: slice) -> Array:
    """(M, 3) points on the rays past the edges of surfaces, from the edge to what is behind [m]."""
    found = []
    for a, b, middle in (
        (np.s_[:, :-1], np.s_[:, 1:], (0.5, 0.0)),
        (np.s_[:-1], np.s_[1:], (0.0, 0.5)),
    ):
        near = np.minimum(depth[rows][a], depth[rows][b])
        jump = np.abs(depth[rows][a] - depth[rows][b])
        r, c = np.nonzero((jump > step[rows][a]) & (near > 0.0))
        count = np.minimum(np.ceil(jump[r, c] / CELL_SIZE), 300).astype(np.intp)
        which = np.repeat(np.arange(len(r)), count)
        along = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
        z = near[r, c][which] + (along + 0.5) * CELL_SIZE
        row = r[which] + (rows.start or 0) + middle[1]
        found.append(_points_at(z, K, c[which] + middle[0], row))
    return np.concatenate(found)


def _middles(p_SP: Array, cluster: Indices) -> Array:
    """(K, 3) middle of the columns from the table up to the points of each cluster [m]."""
    count = int(cluster.max(initial=-1)) + 1
    middles = np.zeros((count, 3))
    order = np.argsort(cluster, kind="stable")
    ends = np.searchsorted(cluster[order], np.arange(count + 1))
    for k in range(count):
        points = p_SP[order[ends[k] : ends[k + 1]]]
        cells = np.round(points[:, :2] / CELL_SIZE).astype(np.int64)
        by_height = np.lexsort((-points[:, 2], cells[:, 1], cells[:, 0]))
        _, first = np.unique(cells[by_height], axis=0, return_index=True)
        top = points[by_height[first]]
        weight = top[:, 2] / top[:, 2].sum()
        middles[k, :2] = weight @ top[:, :2]
        middles[k, 2] = 0.5 * weight @ top[:, 2]
    return middles


@dataclass(frozen=True, eq=False)
class ApproachView:
    """The scene as a height map along one direction of approach.

    Attributes:
        R_SV: (3, 3) axes of the view's frame V, with its origin in S; z points against the
            approach.
        origin: (2,) position in V of the middle of the first cell [m].
        height: (A, B) height in V of what was measured, or else of the table, by cell along x and
            y of V [m].
        hidden: (A, B) height in V up to which space may be occupied that the camera does not
            see [m]; at least `height`.
    """

    R_SV: Array
    origin: Array
    height: Single
    hidden: Single

    @classmethod
    def of(cls, cloud: SceneCloud, R_SV: Array, bounds: Array) -> ApproachView:
        """The view of a cloud along -z of V; `bounds` are those of the observation."""
        low, high = np.asarray(bounds, dtype=float)
        corners = np.array(np.meshgrid(*np.stack([low, high], axis=1))).reshape(3, -1).T @ R_SV
        origin = corners[:, :2].min(axis=0) - MAX_OVERHANG
        shape = np.ceil((corners[:, :2].max(axis=0) + MAX_OVERHANG - origin) / CELL_SIZE).astype(
            int
        )
        x, y = (origin[k] + CELL_SIZE * np.arange(shape[k]) for k in (0, 1))
        table = -(R_SV[2, 0] * x[:, None] + R_SV[2, 1] * y) / R_SV[2, 2]
        seen = _highest(cloud.p_SP @ R_SV, origin, shape)
        hidden = _highest(cloud.p_SH @ R_SV, origin, shape)
        filled = np.isfinite(seen)
        gaps = ndimage.binary_closing(filled, np.ones((3, 3))) & ~filled
        seen[gaps] = ndimage.maximum_filter(seen, 3)[gaps]
        hidden = ndimage.maximum_filter(hidden, 3)
        height = np.maximum(seen, table)
        return cls(
            R_SV,
            origin,
            height.astype(np.float32),
            np.maximum(hidden, height).astype(np.float32),
        )

    def sample(self, values: Floats, x: Floats, y: Floats) -> Floats:
        """Values (...) of a map (A, B) at positions (...) in V [m]; at the border outside of it."""
        i = np.rint((x - self.origin[0]) * (1.0 / CELL_SIZE)).astype(np.int32)
        j = np.rint((y - self.origin[1]) * (1.0 / CELL_SIZE)).astype(np.int32)
        np.clip(i, 0, values.shape[0] - 1, out=i)
        np.clip(j, 0, values.shape[1] - 1, out=j)
        return np.asarray(values.ravel()[i * values.shape[1] + j])


def _highest(p_VP: Array, origin: Array, shape: Indices) -> Array:
    """Largest z of the points (N, 3) in each cell; -inf in cells without points."""
    found = np.full(int(shape[0] * shape[1]), -np.inf)
    i = np.rint((p_VP[:, :2] - origin) / CELL_SIZE).astype(np.intp)
    inside = ((i >= 0) & (i < shape)).all(axis=1)
    np.maximum.at(found, i[inside, 0] * shape[1] + i[inside, 1], p_VP[inside, 2])
    return found.reshape(shape)
