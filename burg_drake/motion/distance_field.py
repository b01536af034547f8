"""Bounds on the distance to everything that does not move: a grid around small solids, exact boxes.

Lower bounds at a point are those of the nearest cell, and hold for the whole cell. Beyond the grid
they are those of the nearest point of the grid: all solids lie inside.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Arrays, Single, cached, content_hash
from burg_drake.geometry import Ball, Boxes, Cylinder, Shape

Points = Single | Sequence[Single]
"""(3, ...) points, or three coordinate arrays that broadcast, such as those of a grid."""


@dataclass(frozen=True, eq=False)
class BoxSolid:
    """A box.

    Attributes:
        X_WB: (4, 4) pose.
        half: (3,) half extents [m].
    """

    X_WB: Array
    half: Array

    @property
    def low(self) -> Array:
        """(3,) lower corner of its bounding box along the world's axes [m]."""
        return np.asarray(self.X_WB[:3, 3] - np.abs(self.X_WB[:3, :3]) @ self.half)

    @property
    def high(self) -> Array:
        """(3,) upper corner of its bounding box along the world's axes [m]."""
        return np.asarray(self.X_WB[:3, 3] + np.abs(self.X_WB[:3, :3]) @ self.half)

    def _face_distances(self, p: Points) -> list[Single]:
        """Distances of points outside each pair of faces; negative between the faces."""
        R = self.X_WB[:3, :3]
        beyond = []
        for axis in range(3):
            offset = np.float32(-R[:, axis] @ self.X_WB[:3, 3])
            along: Single | None = None
            for x, factor in zip(p, R[:, axis], strict=True):
                if abs(factor) > 1e-12:
                    term = x if factor == 1.0 else x * np.float32(factor)
                    along = term if along is None else along + term
            assert along is not None
            value = np.abs(along + offset if offset else along)
            value -= np.float32(self.half[axis])
            beyond.append(value)
        return beyond

    def lower_bound(self, p: Single) -> Single:
        """Lower bound of the distance, exact in front of a face and inside."""
        x, y, z = self._face_distances(p)
        np.maximum(x, y, out=x)
        return np.maximum(x, z, out=x)

    def distance(self, p: Points) -> Single:
        """The signed distance at points."""
        x, y, z = self._face_distances(p)
        inside = np.minimum(np.maximum(np.maximum(x, y), z), 0.0)
        x, y, z = (np.maximum(a, 0.0) for a in (x, y, z))
        return np.asarray(inside + np.sqrt(x * x + y * y + z * z))


@dataclass(frozen=True, eq=False)
class BallSolid:
    """A ball.

    Attributes:
        center: (3,) [m].
        radius: [m].
    """

    center: Array
    radius: float

    @property
    def low(self) -> Array:
        """(3,) lower corner of its bounding box along the world's axes [m]."""
        return np.asarray(self.center - self.radius)

    @property
    def high(self) -> Array:
        """(3,) upper corner of its bounding box along the world's axes [m]."""
        return np.asarray(self.center + self.radius)

    def distance(self, p: Points) -> Single:
        """The signed distance at points."""
        x, y, z = (a - np.float32(c) for a, c in zip(p, self.center, strict=True))
        return np.asarray(np.sqrt(x * x + y * y + z * z) - np.float32(self.radius))


@dataclass(frozen=True, eq=False)
class HullSolid:
    """A convex polytope.

    Attributes:
        normals: (F, 3) outward unit normals.
        offsets: (F,) offsets of its faces' planes [m].
        vertices: (V, 3) [m].
        bulge: how far the true shape may stick out of the faces [m].
    """

    normals: Array
    offsets: Array
    vertices: Array
    bulge: float = 0.0

    @property
    def low(self) -> Array:
        """(3,) lower corner of its bounding box along the world's axes [m]."""
        return np.asarray(self.vertices.min(axis=0) - self.bulge)

    @property
    def high(self) -> Array:
        """(3,) upper corner of its bounding box along the world's axes [m]."""
        return np.asarray(self.vertices.max(axis=0) + self.bulge)

    def grid_lower_bound(self, ticks: list[Array]) -> Single:
        """Lower bound of the distance on a grid (a, b, c): the farthest plane. Exact inside."""
        x, y, z = (np.asarray(t, dtype=np.float32) for t in ticks)
        normals, offsets = self.normals.astype(np.float32), self.offsets.astype(np.float32)
        farthest = np.full((len(x), len(y), len(z)), -np.inf, dtype=np.float32)
        for normal, offset in zip(normals, offsets, strict=True):
            plane = (normal[0] * x)[:, None] + (normal[1] * y - offset)
            np.maximum(farthest, plane[:, :, None] + normal[2] * z, out=farthest)
        return farthest - np.float32(self.bulge)

    def upper_bound(self, p: Array) -> Single:
        """Upper bound of the distance at points (K, 3).

        The length of a path from the point perpendicularly to the farthest plane, and on towards
        the centroid until it is inside: along a line the farthest plane's distance is convex.
        """
        heights = p @ self.normals.T - self.offsets
        farthest = heights.max(axis=1)
        foot = p - np.maximum(farthest, 0.0)[:, None] * self.normals[heights.argmax(axis=1)]
        left = np.maximum((foot @ self.normals.T - self.offsets).max(axis=1), 0.0)
        centroid = self.vertices.mean(axis=0)
        depth = (self.offsets - self.normals @ centroid).min()
        offset = left / (left + depth) * np.linalg.norm(foot - centroid, axis=1)
        return np.asarray(np.where(farthest > 0.0, farthest + offset, farthest), dtype=np.float32)


ProximitySolid = BoxSolid | BallSolid | HullSolid


def solids_hash(solids: list[ProximitySolid]) -> str:
    """Hash of the shapes and poses of solids."""
    return content_hash([[type(solid).__name__, vars(solid)] for solid in solids])


def solid_of(shape: Shape, X_WB: Array) -> ProximitySolid:
    """A shape of a body at a pose (4, 4) as a solid."""
    X_WP = X_WB @ shape.X_BP
    if isinstance(shape.convex, Boxes):
        return BoxSolid(X_WP, shape.half)
    if isinstance(shape.convex, Ball):
        return BallSolid(X_WP[:3, 3], float(shape.half[0]))
    polytope = shape.polytope
    assert polytope is not None
    moved = polytope.moved(X_WP)
    bulge = 0.0
    if isinstance(shape.convex, Cylinder):
        bulge = float(shape.half[0] * (1.0 - np.cos(np.pi / len(polytope.vertices) * 2)))
    return HullSolid(moved.normals, moved.offsets, moved.vertices, bulge)


class DistanceFieldSettings:
    """The grid of a distance field."""

    cell_size = 5e-3  # Metres. Side of a cell.
    max_cells = 3_000_000  # Cells become larger above this number.
    margin = 0.12  # Metres around the solids that the grid covers.
    band = 0.04  # Metres around a convex piece where its faces bound the distance.
    large_side = 1.0  # Metres. Boxes with a longer side stay out of the grid.


@dataclass(frozen=True, eq=False)
class DistanceField:
    """Signed distances, negative inside, to everything that does not move.

    Attributes:
        origin: (3,) centre of the first cell [m].
        cell: side of the cells [m].
        shape: number of cells along each axis.
        lower, upper: (cells,) bounds that hold in the whole cell [m].
        boxes: boxes that are not in the grid.
    """

    origin: Array
    cell: float
    shape: tuple[int, int, int]
    lower: Single
    upper: Single
    boxes: tuple[BoxSolid, ...]

    @classmethod
    def of(cls, solids: list[ProximitySolid]) -> DistanceField:
        """The field of solids in the world, from the user's cache if it is there."""
        large = DistanceFieldSettings.large_side
        boxes = tuple(s for s in solids if isinstance(s, BoxSolid) and 2 * max(s.half) >= large)
        small = [s for s in solids if s not in boxes]
        if not small:
            far = np.full(1, np.inf, dtype=np.float32)
            return cls(np.zeros(3), DistanceFieldSettings.cell_size, (1, 1, 1), far, far, boxes)
        arrays = cached("distances", solids_hash(small), lambda: _grid_arrays(small))
        nx, ny, nz = (int(n) for n in arrays["shape"])
        bounds = arrays["lower"], arrays["upper"]
        return cls(arrays["origin"], float(arrays["cell"]), (nx, ny, nz), *bounds, boxes)

    def index(self, p: Single) -> NDArray[np.intp]:
        """Cells of points (3, ...); the nearest cell for points beyond the grid."""
        ones = (1,) * (p.ndim - 1)
        offset = (0.5 - self.origin / self.cell).astype(np.float32).reshape(3, *ones)
        last = (np.array(self.shape) - 0.5).astype(np.float32).reshape(3, *ones)
        cell = p * np.float32(1.0 / self.cell)
        cell += offset
        np.maximum(cell, np.float32(0.0), out=cell)
        np.minimum(cell, last, out=cell)
        np.floor(cell, out=cell)
        total, y, z = cell
        total *= np.float32(self.shape[1])
        total += y
        total *= np.float32(self.shape[2])
        total += z
        return total.astype(np.intp)  # exact: single precision counts up to 2^24

    def lower_at(self, p: Single) -> Single:
        """Lower bounds (...,) of the distance at points (3, ...) [m]."""
        bound = self.lower.take(self.index(p), mode="clip")
        for box in self.boxes:
            np.minimum(bound, box.lower_bound(p), out=bound)
        return bound

    def upper_at(self, p: Single) -> Single:
        """Upper bounds (...,) at points (3, ...) [m]; infinite where nothing is known."""
        bound = self.upper.take(self.index(p), mode="clip")
        for box in self.boxes:
            np.minimum(bound, box.distance(p), out=bound)
        return bound


def _grid_arrays(small: list[ProximitySolid]) -> Arrays:
    """The grid around solids."""
    low = np.min([s.low for s in small], axis=0)
    high = np.max([s.high for s in small], axis=0)
    margin, smallest = DistanceFieldSettings.margin, DistanceFieldSettings.cell_size
    low -= margin, margin, np.clip(low[2] + smallest, 0.0, margin)
    high += margin
    coarse = float(np.cbrt(np.prod(high - low) / DistanceFieldSettings.max_cells))
    cell = max(smallest, coarse)
    shape = np.ceil((high - low) / cell).astype(int) + 1
    ticks = [a + cell * np.arange(n) for a, n in zip(low, shape, strict=True)]
    lower, upper = _grid_bounds(ticks, cell, small)
    slack = np.float32(cell * np.sqrt(3.0) / 2)
    lower -= slack
    upper += slack
    for axis in range(3):  # boundary cells stand for points beyond the grid
        np.moveaxis(upper, axis, 0)[[0, -1]] = np.inf
    bounds = {"lower": lower.reshape(-1), "upper": upper.reshape(-1)}
    return {"origin": low, "cell": np.array(cell), "shape": shape, **bounds}


def _grid_bounds(
    ticks: list[Array], cell: float, solids: list[ProximitySolid]
) -> tuple[Single, Single]:
    """Bounds at the cells' centres."""
    shape = tuple(len(t) for t in ticks)
    near = np.full(shape, DistanceFieldSettings.band, dtype=np.float32)
    reach = np.float32(cell * np.sqrt(3.0) / 2)
    seed = np.full(shape, np.inf, dtype=np.float32)  # upper bounds of occupied cells
    exact = np.full(shape, np.inf, dtype=np.float32)
    grid = [t.astype(np.float32) for t in np.meshgrid(*ticks, indexing="ij", sparse=True)]
    hulls = False
    for solid in solids:
        if not isinstance(solid, HullSolid):
            np.minimum(exact, solid.distance(grid), out=exact)
            continue
        hulls = True
        window, local = _grid_window(ticks, solid, DistanceFieldSettings.band)
        below = solid.grid_lower_bound(local)
        np.minimum(near[window], below, out=near[window])
        occupied = below <= reach
        centers = np.stack(np.meshgrid(*local, indexing="ij"))[:, occupied]
        view = seed[window]
        view[occupied] = np.minimum(view[occupied], solid.upper_bound(centers.T))
    if not hulls:
        return exact, exact.copy()
    from scipy.ndimage import distance_transform_edt  # not needed if the field is cached

    occupied = np.isfinite(seed)
    nearest = distance_transform_edt(
        ~occupied, sampling=cell, return_distances=False, return_indices=True
    )
    squared = np.zeros(shape)
    for cells, own in zip(nearest, np.indices(shape, sparse=True), strict=True):
        squared += ((cells - own) * cell) ** 2
    distance = np.sqrt(squared).astype(np.float32)
    upper = distance + seed[tuple(nearest)]
    lower = np.where(occupied, near, np.maximum(distance - reach, near))
    return np.minimum(lower, exact), np.minimum(upper, exact)


def _grid_window(
    ticks: list[Array], solid: ProximitySolid, margin: float
) -> tuple[tuple[slice, ...], list[Array]]:
    """The part of the grid within a margin of a solid's box."""
    window = []
    for tick, low, high in zip(ticks, solid.low, solid.high, strict=True):
        a, b = np.searchsorted(tick, [low - margin, high + margin])
        window.append(slice(max(a, 0), b))
    return tuple(window), [tick[part] for tick, part in zip(ticks, window, strict=True)]
