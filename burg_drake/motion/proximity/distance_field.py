"""Bounds on the distance to all that stands still: a grid around what is small, boxes exactly.

Lower bounds at a point are the grid's value at the nearest cell, which holds for the whole cell,
and beyond the grid that at the nearest point of the grid: as all solids lie inside, none is nearer
to a point than to its projection onto the grid's box.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Arrays, Single, cached
from burg_drake.motion.proximity.solids import BoxSolid, HullSolid, ProximitySolid, content_of

CELL = 5e-3
"""Side of a cell [m]."""
MAX_CELLS = 3_000_000
"""Above this many cells they become larger."""
MARGIN = 0.12
"""Of the grid around the solids [m]: as far out distances are known."""
BAND = 0.04
"""Out to this distance from a convex piece the planes of its faces bound the distance [m]."""
LARGE = 1.0
"""Boxes with a side of at least this [m] stay out of the grid."""


@dataclass(frozen=True, eq=False)
class DistanceField:
    """Signed distances, negative inside, to everything that does not move.

    Attributes:
        origin: (3,) centre of the first cell [m].
        cell: side of the cells [m].
        shape: number of cells along each axis.
        lower, upper: (cells,) bounds that hold in the whole cell [m].
        boxes: those that are not in the grid.
    """

    origin: Array
    cell: float
    shape: tuple[int, int, int]
    lower: Single
    upper: Single
    boxes: tuple[BoxSolid, ...]

    @classmethod
    def of(cls, solids: list[ProximitySolid]) -> DistanceField:
        """The field of solids in the world; of solids seen before, from the user's cache."""
        boxes = tuple(s for s in solids if isinstance(s, BoxSolid) and 2 * max(s.half) >= LARGE)
        small = [s for s in solids if s not in boxes]
        if not small:
            far = np.full(1, np.inf, dtype=np.float32)
            return cls(np.zeros(3), CELL, (1, 1, 1), far, far, boxes)
        arrays = cached("distances", content_of(small), lambda: _arrays(small))
        nx, ny, nz = (int(n) for n in arrays["shape"])
        return cls(
            arrays["origin"],
            float(arrays["cell"]),
            (nx, ny, nz),
            arrays["lower"],
            arrays["upper"],
            boxes,
        )

    def index(self, p: Single) -> NDArray[np.intp]:
        """Cells of points (3, ...); of points beyond the grid the nearest cell."""
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
            np.minimum(bound, box.below(p), out=bound)
        return bound

    def upper_at(self, p: Single) -> Single:
        """Upper bounds (...,) at points (3, ...) [m]; infinite where nothing is known."""
        bound = self.upper.take(self.index(p), mode="clip")
        for box in self.boxes:
            np.minimum(bound, box.distance(p), out=bound)
        return bound


def _arrays(small: list[ProximitySolid]) -> Arrays:
    """The grid around solids."""
    low = np.min([s.low for s in small], axis=0)
    high = np.max([s.high for s in small], axis=0)
    low -= (MARGIN, MARGIN, np.clip(low[2] + CELL, 0.0, MARGIN))
    high += MARGIN
    cell = max(CELL, float(np.cbrt(np.prod(high - low) / MAX_CELLS)))
    shape = np.ceil((high - low) / cell).astype(int) + 1
    ticks = [a + cell * np.arange(n) for a, n in zip(low, shape, strict=True)]
    lower, upper = _bounds_at(ticks, cell, small)
    slack = np.float32(cell * np.sqrt(3.0) / 2)
    lower -= slack
    upper += slack
    for axis in range(3):  # where points beyond the grid are looked up
        np.moveaxis(upper, axis, 0)[[0, -1]] = np.inf
    bounds = {"lower": lower.reshape(-1), "upper": upper.reshape(-1)}
    return {"origin": low, "cell": np.array(cell), "shape": shape, **bounds}


def _bounds_at(
    ticks: list[Array], cell: float, solids: list[ProximitySolid]
) -> tuple[Single, Single]:
    """Bounds at the cells' centres."""
    shape = tuple(len(t) for t in ticks)
    near = np.full(shape, BAND, dtype=np.float32)
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
        window, local = _window(ticks, solid, BAND)
        below = solid.below_on(local)
        np.minimum(near[window], below, out=near[window])
        occupied = below <= reach
        at = np.stack(np.meshgrid(*local, indexing="ij"))[:, occupied]
        view = seed[window]
        view[occupied] = np.minimum(view[occupied], solid.above(at.T))
    if not hulls:
        return exact, exact.copy()
    from scipy.ndimage import distance_transform_edt  # not needed for what is in the cache

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


def _window(
    ticks: list[Array], solid: ProximitySolid, margin: float
) -> tuple[tuple[slice, ...], list[Array]]:
    """The part of the grid within a margin of a solid's box."""
    window = []
    for tick, low, high in zip(ticks, solid.low, solid.high, strict=True):
        a, b = np.searchsorted(tick, [low - margin, high + margin])
        window.append(slice(max(a, 0), b))
    return tuple(window), [tick[part] for tick, part in zip(ticks, window, strict=True)]
