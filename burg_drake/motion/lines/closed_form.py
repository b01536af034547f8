"""Chains of the Panda's postures from pregrasp over grasp to the top of the lift.

The redundant joint is swept at some poses of the way (layers); the best chain through them is
refined until the hand goes straight, and held against bounds of the arm's clearance. What collides
is put out, and the next best chain takes its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from burg_drake.core import Array, Indices
from burg_drake.motion.lines.dense_rows import (
    ClosedFormFiller,
    DenseRows,
    NumericFiller,
    straighten,
)
from burg_drake.motion.lines.failure_reason import GridPlace, failure
from burg_drake.motion.lines.grid_builder import START, PostureGridBuilder, counted_clearance
from burg_drake.motion.lines.line_search import Chain, Failure
from burg_drake.motion.lines.posture_grid import GridChain, PostureGrid

ROWS_A_LAYER = 5
"""Rows of a chain from one layer to the next: 1 cm."""
DOUBT = 0.5
"""A posture that may be in collision costs as much as this way of a joint [rad]; less with some
clearance, see `PostureGrid.best`."""
PATIENCE = 2
"""Chains of a grasp that may fail before all of its postures are measured."""
FAILURES = 12
"""Chains of a grasp that may fail before a finer grid is opened, or the grasp given up."""
AROUND = 2
"""A start that the arm does not get to is left out with so many values of the redundant joint to
either side of it."""


class ClosedFormLineSearch(PostureGridBuilder):
    """Looks for chains of a Panda in a scene; for the arguments see `PostureGridBuilder`."""

    def lifted(self, height: float) -> ClosedFormLineSearch:
        """See `LineSearch`."""
        lines = replace(self.lines, lift=height)
        return ClosedFormLineSearch(
            *(self.arm, self.ik, lines, self.proximity, self.home, self.settings)
        )

    def begin(self, X_AG: Array, clearance: Array) -> _ClosedFormBatch:
        """See `LineSearch`."""
        return _ClosedFormBatch(self, X_AG, clearance)

    def straight(self, X_AG: Array, corners: Array, at: Array, tolerance: Array) -> DenseRows:
        """Fills in rows between the postures of chains at the layers; see `straighten`.

        The redundant joint goes straight from layer to layer. Where no postures follow each other
        that way, at a fold or past the upright upper arm, all joints are solved for together.
        """
        every = ClosedFormFiller(self.lines, X_AG, corners, self.layers, self.ik)
        rows = straighten(every, at, tolerance)
        broken = np.unique(rows.chain[rows.broken])
        if not len(broken):
            return rows
        bent = NumericFiller(
            *(self.lines, X_AG[broken], corners[broken], self.layers, self.arm, self.settings)
        )
        return rows.replaced(broken, straighten(bent, at, tolerance[broken]))


@dataclass(frozen=True, eq=False)
class _Found:
    """A chain's place: the grid that it was found in, the grasp's index there, and its postures."""

    grid: PostureGrid
    index: int
    place: GridChain
    layer: Array
    """(M,) layer of each row; a fraction between two."""


class _ClosedFormBatch:
    """See `line_search.LineSearch`."""

    def __init__(self, search: ClosedFormLineSearch, X_AG: Array, clearance: Array) -> None:
        self._search, self._X_AG = search, X_AG
        self._tolerance = clearance
        n = len(X_AG)
        self._grids: list[list[GridPlace]] = [[] for _ in range(n)]
        self._level = np.full(n, -1)
        self._failed = np.zeros(n, dtype=int)
        self._farthest = np.zeros(n)
        self._closed = np.zeros((n, 2), dtype=bool)
        self._advance(np.arange(n))

    def propose(self, grasps: Sequence[int]) -> list[Chain | None]:
        """See `LineSearch`."""
        found: dict[int, Chain | None] = {}
        left = list(grasps)
        while left:
            rows = self._best(left, found)
            left = [g for g in left if g not in found]
            if not rows:
                continue
            for grasp, chain in self._refine(rows).items():
                if chain is not None:
                    found[grasp] = chain
            left = [g for g in left if g not in found]
            self._measure_failing(left)
        return [found[g] for g in grasps]

    def refuse(self, grasp: int, chain: Chain, row: int | None) -> None:
        """See `LineSearch`."""
        found: _Found = chain.place
        if row is None:
            place = found.place
            k = place.parameter[0]
            around = slice(max(0, k - AROUND), k + AROUND + 1)
            found.grid.refused[0, found.index, place.flip, place.branch[0], around] = True
        else:
            self._exclude(grasp, found, float(found.layer[row]))
            self._farthest[grasp] = max(self._farthest[grasp], found.layer[row])
        self._failed[grasp] += 1

    def close(self, grasp: int, flip: int) -> None:
        """See `LineSearch`."""
        self._closed[grasp, flip] = True
        for grid, i in self._grids[grasp]:
            grid.refused[:, i, flip] = True

    def failure(self, grasp: int) -> Failure:
        """See `LineSearch`."""
        places, farthest = self._grids[grasp], float(self._farthest[grasp])
        return failure(self._search, self._X_AG[grasp], places, farthest)

    def _best(
        self, grasps: Sequence[int], found: dict[int, Chain | None]
    ) -> list[tuple[int, PostureGrid, int, GridChain]]:
        """The cheapest chains; grasps without one go on to more values of the redundant joint."""
        by_grid: dict[int, tuple[PostureGrid, list[int]]] = {}
        for g in grasps:
            grid, _ = self._grids[g][-1]
            by_grid.setdefault(id(grid), (grid, []))[1].append(g)
        rows, exhausted = [], []
        for grid, members in by_grid.values():
            index = np.array([self._grids[g][-1][1] for g in members])
            places = grid.best(index, DOUBT)
            for g, i, place in zip(members, index, places, strict=True):
                if place is None or self._failed[g] >= FAILURES:
                    exhausted.append(g)
                else:
                    rows.append((g, grid, int(i), place))
        last = len(self._search.settings.redundant) - 1
        for g in exhausted:
            if self._level[g] == last:
                found[g] = None
        self._advance(np.array([g for g in exhausted if self._level[g] < last], dtype=np.intp))
        return rows

    def _advance(self, grasps: Indices) -> None:
        """Opens a finer grid for grasps: finds the postures at pregrasp and grasp, the others where
        both are reached, and measures at both what chains lead over."""
        if not len(grasps):
            return
        for level in np.unique(self._level[grasps]) + 1:
            members = grasps[self._level[grasps] == level - 1]
            grid = self._search.grid(self._X_AG[members], self._search.settings.redundant[level])
            ends = list(dict.fromkeys([self._search.at_grasp, 0]))
            alive = np.arange(len(members))
            for layer in ends:
                grid.solve(np.array([layer]), alive)
                alive = alive[grid.exists[layer, alive].any(axis=(1, 2, 3))]
            others = np.setdiff1d(np.arange(grid.poses), ends)
            if len(alive) and len(others):
                grid.solve(others, alive)
            grid.join()
            for i, g in enumerate(members.tolist()):
                for coarse, index in self._grids[g][-1:]:
                    grid.take_over(i, coarse, index, ends)
            flip = np.abs(grid.q[:, 0] - self._search.home[:, None, None, None, None]).max(axis=0)
            grid.start[:] = START * np.nan_to_num(flip)
            alive = alive[grid.joined[0, alive].any(axis=(1, 2, 3))]
            for layer in ends:
                self._search.measure(grid, np.array([layer]), alive, grid.joined)
                usable = grid.joined[layer, alive] & (grid.upper[layer, alive] > 0.0)
                alive = alive[usable.any(axis=(1, 2, 3))]
            for i, g in enumerate(members.tolist()):
                self._grids[g].append((grid, i))
                grid.refused[:, i, self._closed[g]] = True
            self._level[members] = level
            self._failed[members] = 0

    def _measure_failing(self, grasps: Sequence[int]) -> None:
        """Measures all postures of grasps whose chains keep failing."""
        by_grid: dict[int, tuple[PostureGrid, list[int]]] = {}
        for g in grasps:
            if self._failed[g] == PATIENCE:
                grid, i = self._grids[g][-1]
                by_grid.setdefault(id(grid), (grid, []))[1].append(i)
        for grid, members in by_grid.values():
            self._search.measure(grid, np.arange(grid.poses), np.array(members), grid.joined)

    def _refine(
        self, rows: list[tuple[int, PostureGrid, int, GridChain]]
    ) -> dict[int, Chain | None]:
        """Chains whose hand goes straight and that are not in collision as far as is known; None
        where that is not so, and what keeps it from being so is put out."""
        search = self._search
        count = len(search.layers)
        at = np.linspace(0.0, count - 1.0, (count - 1) * ROWS_A_LAYER + 1)
        grasp = np.array([g for g, *_ in rows])
        flip = np.array([place.flip for *_, place in rows])
        X_AG = self._X_AG[grasp, flip]
        corners = np.array(
            [
                grid.q[:, np.arange(count), i, p.flip, p.branch, p.parameter].T
                for _, grid, i, p in rows
            ]
        )
        tolerance = np.clip(0.5 * self._tolerance[grasp, flip], *search.settings.deviation)
        straight = search.straight(X_AG, corners, at, tolerance)
        bounds = search.proximity.bounds(straight.q, hand=False)
        upper = counted_clearance(bounds, search.settings.exact)
        return {
            g: self._chain(g, _Found(grid, i, place, np.empty(0)), k, straight, bounds.lower, upper)
            for k, (g, grid, i, place) in enumerate(rows)
        }

    def _chain(
        self, grasp: int, found: _Found, k: int, rows: DenseRows, lower: Array, upper: Array
    ) -> Chain | None:
        own = rows.of(k)
        layer = rows.layer[own]
        found = replace(found, layer=layer)
        broken = rows.broken[own] | ~(upper[own] > 0.0)
        if broken.any():
            for row in np.flatnonzero(broken):
                self._exclude(grasp, found, float(layer[row]))
            self._farthest[grasp] = max(self._farthest[grasp], layer[broken][0])
            self._failed[grasp] += 1
            return None
        length = np.interp(layer, np.arange(len(self._search.layers)), self._search.layers)
        return Chain(
            flip=found.place.flip,
            q=rows.q[own],
            at_grasp=int(np.searchsorted(layer, self._search.at_grasp)),
            at_retreated=int(np.searchsorted(layer, self._search.lines.at_retreated)),
            moved_W=self._search.lines.carried(self._X_AG[grasp, found.place.flip], length),
            lower=lower[own],
            place=found,
        )

    def _exclude(self, grasp: int, found: _Found, layer: float) -> None:
        """Puts the posture at a layer out of the search, or the step between two.

        Where chains keep failing the neighbours go with it, so that the next chain leads elsewhere.
        """
        grid, place = found.grid, found.place
        widely = self._failed[grasp] >= PATIENCE
        nearest = round(layer)
        if layer == nearest or widely:
            k = place.parameter[nearest]
            around = slice(max(0, k - widely), k + widely + 1)
            grid.refused[nearest, found.index, place.flip, place.branch[nearest], around] = True
        else:
            grid.cut(found.index, int(layer), place)
