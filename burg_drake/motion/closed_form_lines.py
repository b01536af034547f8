"""Chains of the Panda's postures from pregrasp over grasp to the top of the lift.

The redundant joint is swept at some poses of the path (layers). The best chain through the layers
is refined until the hand goes straight, and checked against bounds of the clearance. A chain in
collision is rejected, and the next best takes its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from burg_drake.core import Array, Indices, Outcome
from burg_drake.motion.line_poses import ClosedFormFiller, DenseRows, NumericFiller, straighten_rows
from burg_drake.motion.line_search import Chain, Failure
from burg_drake.motion.panda_ik import PandaIk
from burg_drake.motion.posture_grid import (
    START_COST,
    GridChain,
    PostureGrid,
    PostureGridBuilder,
    decisive_clearance,
)

GridPlace = tuple[PostureGrid, int]
"""A grid, and the number of a grasp in it."""


class ChainSearchSettings:
    """Effort of the search for chains."""

    max_explained = 3  # Blocking postures that a failure names.
    rows_per_layer = 5  # Rows of a chain from one layer to the next; 1 cm apart.
    doubt_cost = 0.5  # Radians. Cost of a posture that may be in collision.
    failures_before_measuring = 2  # Failed chains of a grasp before all its postures are measured.
    max_failures = 12  # Failed chains of a grasp before a finer grid is opened.


def explain_failure(
    search: PostureGridBuilder, X_AG: Array, places: Sequence[GridPlace], farthest: float
) -> Failure:
    """Why a grasp has no chain.

    Args:
        search: the search for postures.
        X_AG: (2, 4, 4) the grasp with both finger assignments.
        places: grids of the grasp and its number in each, the coarsest first.
        farthest: the farthest layer that a refused chain reached.
    """
    grid, i = places[-1]
    ends = [0, search.at_grasp]
    if not grid.exists[ends, i].any(axis=(1, 2, 3)).all():
        return _limit_failure(search, X_AG)
    for layer in ends:
        if not _is_any_free(search, places, layer):
            return _blocking_postures(search, X_AG, places, Outcome.ARM_COLLISION, layer)
    last = grid.reached(i) + 1
    if not 0 < last < grid.poses:
        # If chains are left, the search has given them up.
        last = int(np.ceil(farthest))
    outcome = search.hand_path.outcome(last)
    return _blocking_postures(search, X_AG, places, outcome, last)


def _is_any_free(search: PostureGridBuilder, places: Sequence[GridPlace], layer: int) -> bool:
    """Whether a measured posture at a layer is not known to collide. If there is none yet, measures
    all postures of the first grid that has any at this layer."""
    if any(grid.measured_free(layer, i) for grid, i in places):
        return True
    grid, i = next((g, i) for g, i in places if g.exists[layer, i].any())
    search.measure(grid, np.array([layer]), np.array([i]), grid.exists)
    return grid.measured_free(layer, i)


def _blocking_postures(
    search: PostureGridBuilder,
    X_AG: Array,
    places: Sequence[GridPlace],
    outcome: Outcome,
    layer: int,
) -> Failure:
    """Failure with the blocked postures at a layer, the nearest to being free first; if none is
    blocked, with the smallest excess over the joint limits or the reason."""
    for grid, i in places:
        search.measure(grid, np.array([layer]), np.array([i]), grid.exists)
        blocked = grid.exists[layer, i] & ~grid.usable(layer, i)
        if blocked.any():
            break
    else:
        layers = {layer, search.hand_path.segment_end(layer)}
        return Failure.of_line(outcome, max(_limit_excess(search, X_AG, k) for k in layers))
    where = np.argwhere(blocked)
    order = np.argsort(-grid.upper[layer, i][blocked], kind="stable")[
        : ChainSearchSettings.max_explained
    ]
    chosen = tuple(where[order].T)
    q = grid.q[(slice(None), layer, i, *chosen)].T
    moved_W = search.hand_path.target_displacement(X_AG[chosen[0]], search.layers[[layer]])
    return Failure(outcome, q=q, moved_W=moved_W)


def _limit_failure(search: PostureGridBuilder, X_AG: Array) -> Failure:
    """`JOINT_LIMIT` with the smallest excess, or `NO_IK` if no posture exists without limits."""
    excess = max(_limit_excess(search, X_AG, layer) for layer in (0, search.at_grasp))
    if excess == np.inf:
        return Failure(Outcome.NO_IK)
    return Failure(Outcome.JOINT_LIMIT, excess=excess)


def _limit_excess(search: PostureGridBuilder, X_AG: Array, layer: int) -> float:
    """Smallest excess of a posture at a layer over the joint limits [rad]; infinite if the pose has
    no posture even without limits.

    The redundant joint is swept, then swept finely around its best values.
    """
    best_values, fine_values, rounds = 4, 9, 3
    ik = search.ik
    X_AH = search.hand_path.X_AH(X_AG, search.layers[layer])
    step = 2.0 * np.pi / search.settings.redundant[-1]
    values = np.arange(-np.pi, np.pi, step)
    smallest = np.inf
    for _ in range(rounds):
        excess, q7 = _excess_by_value(ik, X_AH, values)
        if not len(excess):
            break
        smallest = min(smallest, float(excess.min()))
        best = np.unique(q7[np.argsort(excess, kind="stable")[:best_values]])
        values = (best[:, None] + step * np.linspace(-1.0, 1.0, fine_values)).ravel()
        step /= (fine_values - 1) / 2
    return max(0.0, smallest)


def _excess_by_value(ik: PandaIk, X_AH: Array, values: Array) -> tuple[Array, Array]:
    """Excess over the joint limits (S,) [rad] of all postures at two hand poses (2, 4, 4), each
    joint turned to within half a turn of the middle of its range; and their values (S,) of the
    redundant joint [rad]."""
    turn, middle = 2.0 * np.pi, 0.5 * (ik.lower + ik.upper)
    unlimited = replace(ik, lower=np.full(len(middle), -turn), upper=np.full(len(middle), turn))
    found = unlimited.solve(X_AH, values)
    q = middle + (found.q - middle + np.pi) % turn - np.pi
    excess = np.maximum(ik.lower - q, q - ik.upper).max(axis=1)
    return excess, values[found.parameter]


class ClosedFormLineSearch(PostureGridBuilder):
    """Looks for chains of a Panda in a scene; for the arguments see `PostureGridBuilder`."""

    def lifted(self, height: float) -> ClosedFormLineSearch:
        """See `LineSearch`."""
        hand_path = replace(self.hand_path, lift=height)
        return ClosedFormLineSearch(
            *(self.arm, self.ik, hand_path, self.proximity, self.home, self.settings)
        )

    def begin(self, X_AG: Array, clearance: Array) -> _ClosedFormBatch:
        """See `LineSearch`."""
        return _ClosedFormBatch(self, X_AG, clearance)

    def fill_rows(self, X_AG: Array, corners: Array, at: Array, tolerance: Array) -> DenseRows:
        """Fills in rows between the postures of chains at the layers; see `straighten_rows`.

        The redundant joint is linear from layer to layer. Where the postures are not continuous
        then, at a fold or past the upright upper arm, the numeric filler solves for all joints.
        """
        filler = ClosedFormFiller(self.hand_path, X_AG, corners, self.layers, self.ik)
        rows = straighten_rows(filler, at, tolerance)
        broken = np.unique(rows.chain[rows.broken])
        if not len(broken):
            return rows
        numeric = NumericFiller(
            *(self.hand_path, X_AG[broken], corners[broken], self.layers, self.arm, self.settings)
        )
        return rows.replaced(broken, straighten_rows(numeric, at, tolerance[broken]))


@dataclass(frozen=True, eq=False)
class _FoundChain:
    """A chain in a grid: the grid, the number of the grasp in it, and the chain's postures."""

    grid: PostureGrid
    index: int
    postures: GridChain
    layer: Array
    """(M,) layer of each row; a fraction between two."""


class _ClosedFormBatch:
    """See `LineSearchBatch`."""

    def __init__(self, search: ClosedFormLineSearch, X_AG: Array, clearance: Array) -> None:
        self._search, self._X_AG = search, X_AG
        self._clearance = clearance
        n = len(X_AG)
        self._grids: list[list[GridPlace]] = [[] for _ in range(n)]
        self._level = np.full(n, -1)
        self._failed_chains = np.zeros(n, dtype=int)
        self._farthest_layer = np.zeros(n)
        self._closed = np.zeros((n, 2), dtype=bool)
        self._advance(np.arange(n))

    def propose(self, grasps: Sequence[int]) -> list[Chain | None]:
        """See `LineSearch`."""
        found: dict[int, Chain | None] = {}
        left = list(grasps)
        while left:
            rows = self._choose_chains(left, found)
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
        excluded_values = 2  # Neighbouring values of the redundant joint that are excluded, too.
        found: _FoundChain = chain.place
        if row is None:
            postures = found.postures
            k = postures.parameter[0]
            around = slice(max(0, k - excluded_values), k + excluded_values + 1)
            found.grid.refused[0, found.index, postures.flip, postures.branch[0], around] = True
        else:
            self._exclude(grasp, found, float(found.layer[row]))
            self._farthest_layer[grasp] = max(self._farthest_layer[grasp], found.layer[row])
        self._failed_chains[grasp] += 1

    def close(self, grasp: int, flip: int) -> None:
        """See `LineSearch`."""
        self._closed[grasp, flip] = True
        for grid, i in self._grids[grasp]:
            grid.refused[:, i, flip] = True

    def failure(self, grasp: int) -> Failure:
        """See `LineSearch`."""
        places, farthest = self._grids[grasp], float(self._farthest_layer[grasp])
        return explain_failure(self._search, self._X_AG[grasp], places, farthest)

    def _choose_chains(
        self, grasps: Sequence[int], found: dict[int, Chain | None]
    ) -> list[tuple[int, PostureGrid, int, GridChain]]:
        """The cheapest chains; grasps without one get a finer grid, or None in `found`."""
        by_grid: dict[int, tuple[PostureGrid, list[int]]] = {}
        for g in grasps:
            grid, _ = self._grids[g][-1]
            by_grid.setdefault(id(grid), (grid, []))[1].append(g)
        rows, exhausted = [], []
        for grid, members in by_grid.values():
            index = np.array([self._grids[g][-1][1] for g in members])
            cheapest = grid.best(index, ChainSearchSettings.doubt_cost)
            for g, i, postures in zip(members, index, cheapest, strict=True):
                if postures is None or self._failed_chains[g] >= ChainSearchSettings.max_failures:
                    exhausted.append(g)
                else:
                    rows.append((g, grid, int(i), postures))
        last = len(self._search.settings.redundant) - 1
        for g in exhausted:
            if self._level[g] == last:
                found[g] = None
        self._advance(np.array([g for g in exhausted if self._level[g] < last], dtype=np.intp))
        return rows

    def _advance(self, grasps: Indices) -> None:
        """Opens a finer grid for grasps.

        Solves for the postures at pregrasp and grasp and, where both exist, at the other layers.
        Measures those at pregrasp and grasp that chains pass through.
        """
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
                    grid.copy_deep_collisions(i, coarse, index, ends)
            from_home = np.abs(grid.q[:, 0] - self._search.home[:, None, None, None, None])
            grid.start[:] = START_COST * np.nan_to_num(from_home.max(axis=0))
            alive = alive[grid.joined[0, alive].any(axis=(1, 2, 3))]
            for layer in ends:
                self._search.measure(grid, np.array([layer]), alive, grid.joined)
                usable = grid.joined[layer, alive] & (grid.upper[layer, alive] > 0.0)
                alive = alive[usable.any(axis=(1, 2, 3))]
            for i, g in enumerate(members.tolist()):
                self._grids[g].append((grid, i))
                grid.refused[:, i, self._closed[g]] = True
            self._level[members] = level
            self._failed_chains[members] = 0

    def _measure_failing(self, grasps: Sequence[int]) -> None:
        """Measures all postures of grasps whose chains have failed repeatedly."""
        by_grid: dict[int, tuple[PostureGrid, list[int]]] = {}
        for g in grasps:
            if self._failed_chains[g] == ChainSearchSettings.failures_before_measuring:
                grid, i = self._grids[g][-1]
                by_grid.setdefault(id(grid), (grid, []))[1].append(i)
        for grid, members in by_grid.values():
            self._search.measure(grid, np.arange(grid.poses), np.array(members), grid.joined)

    def _refine(
        self, rows: list[tuple[int, PostureGrid, int, GridChain]]
    ) -> dict[int, Chain | None]:
        """Chains with a straight hand motion and no known collision. None for the others, whose
        failing postures are excluded."""
        search = self._search
        count = len(search.layers)
        at = np.linspace(0.0, count - 1.0, (count - 1) * ChainSearchSettings.rows_per_layer + 1)
        grasp = np.array([g for g, *_ in rows])
        flip = np.array([postures.flip for *_, postures in rows])
        X_AG = self._X_AG[grasp, flip]
        layers = np.arange(count)
        corners = np.array(
            [grid.q[:, layers, i, p.flip, p.branch, p.parameter].T for _, grid, i, p in rows]
        )
        tolerance = np.clip(0.5 * self._clearance[grasp, flip], *search.settings.deviation)
        straight = search.fill_rows(X_AG, corners, at, tolerance)
        bounds = search.proximity.bounds(straight.q, hand=False)
        upper = decisive_clearance(bounds, search.settings.exact)
        return {
            g: self._chain(
                g, _FoundChain(grid, i, postures, np.empty(0)), k, straight, bounds.lower, upper
            )
            for k, (g, grid, i, postures) in enumerate(rows)
        }

    def _chain(
        self, grasp: int, found: _FoundChain, k: int, rows: DenseRows, lower: Array, upper: Array
    ) -> Chain | None:
        own = rows.slice_of(k)
        layer = rows.layer[own]
        found = replace(found, layer=layer)
        broken = rows.broken[own] | ~(upper[own] > 0.0)
        if broken.any():
            for row in np.flatnonzero(broken):
                self._exclude(grasp, found, float(layer[row]))
            self._farthest_layer[grasp] = max(self._farthest_layer[grasp], layer[broken][0])
            self._failed_chains[grasp] += 1
            return None
        flip = found.postures.flip
        return self._search.hand_path.chain(self._X_AG[grasp, flip], flip, rows, own, lower, found)

    def _exclude(self, grasp: int, found: _FoundChain, layer: float) -> None:
        """Excludes the posture at a layer, or the step between two layers, from the search.

        After repeated failures its neighbours are excluded, too, so that the next chain differs.
        """
        grid, postures = found.grid, found.postures
        widely = self._failed_chains[grasp] >= ChainSearchSettings.failures_before_measuring
        nearest = round(layer)
        if layer == nearest or widely:
            k = postures.parameter[nearest]
            around = slice(max(0, k - widely), k + widely + 1)
            branch = postures.branch[nearest]
            grid.refused[nearest, found.index, postures.flip, branch, around] = True
        else:
            grid.cut(found.index, int(layer), postures)
