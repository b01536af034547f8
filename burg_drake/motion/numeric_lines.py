"""Chains of postures from pregrasp over grasp to the top of the lift, for any serial arm.

Postures at the grasp come from the arm's inverse kinematics. Each is followed along both straight
segments, step by step, which makes a chain unless a joint reaches its limit or jumps. The best
chain is filled in until the hand goes straight, and checked against bounds of the clearance. A
chain in collision is rejected, and the next best takes its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Indices, Outcome
from burg_drake.motion.clearance_bounds import ArmProximity
from burg_drake.motion.closed_form_lines import ChainSearchSettings
from burg_drake.motion.ik_solutions import ArmSolutions, NumericSolutions
from burg_drake.motion.line_poses import (
    DenseRows,
    HandPath,
    NumericFiller,
    solve_ik_near,
    straighten_rows,
)
from burg_drake.motion.line_search import Chain, Failure
from burg_drake.motion.motion_settings import ReachSettings
from burg_drake.motion.numeric_ik import ArmKinematics
from burg_drake.motion.posture_grid import START_COST, decisive_clearance

GRASP, APPROACH, RETREAT, LIFT, COMPLETE_CHAIN = range(5)
"""Stage at which a candidate failed: grasp, approach, retreat or lift; the last: not at all."""


@dataclass(eq=False)
class ChainCandidates:
    """C postures at a grasp, each with its continuation at L poses of the path.

    Attributes:
        flip: (C,) finger assignment, 0 or 1.
        q: (C, L, n) arm positions; NaN beyond the end of the continuation.
        stage: (C,) stage at which the candidate failed.
        cost: (C,) cost of complete chains; infinite for others.
        open: (C,) whether the candidate may still be proposed.
    """

    flip: Indices
    q: Array
    stage: Indices
    cost: Array
    open: NDArray[np.bool_]
    _blocked: list[tuple[int, float, Array, Array]] = field(default_factory=list)
    _closed: set[int] = field(default_factory=set)

    @classmethod
    def empty(cls, poses: int, joints: int) -> Self:
        """No candidates yet."""
        index = np.empty(0, np.intp)
        return cls(index, np.empty((0, poses, joints)), index, np.empty(0), np.empty(0, dtype=bool))

    def __len__(self) -> int:
        return len(self.flip)

    def add(self, flip: Indices, q: Array, pose: int) -> Indices:
        """Adds postures at one of the poses, without duplicates.

        Args:
            flip: (S,) finger assignments.
            q: (S, n) arm positions.
            pose: index of the pose.

        Returns:
            Indices of the new candidates.
        """
        first = len(self)
        if not len(q):
            return np.empty(0, np.intp)
        all_flips, all_q = np.append(self.flip, flip), np.concatenate([self.q[:, pose], q])
        # Postures whose joints are no more than 0.05 rad or m apart count as the same.
        same = np.abs(all_q[first:, None] - all_q).max(axis=-1) <= 0.05
        same &= all_flips[first:, None] == all_flips
        kept = np.flatnonzero(same.argmax(axis=1) == np.arange(first, len(all_q)))
        count = len(kept)
        new = np.full((count, *self.q.shape[1:]), np.nan)
        new[:, pose] = q[kept]
        self.flip = np.append(self.flip, flip[kept])
        self.q = np.concatenate([self.q, new])
        self.stage = np.append(self.stage, np.full(count, GRASP))
        self.cost = np.append(self.cost, np.full(count, np.inf))
        self.open = np.append(self.open, np.zeros(count, dtype=bool))
        return np.arange(first, first + count)

    def complete(self, k: int, q: Array, cost: float) -> None:
        """Stores the complete chain (L, n) of a candidate and opens it for proposal."""
        self.q[k], self.cost[k], self.stage[k] = q, cost, COMPLETE_CHAIN
        self.open[k] = self.flip[k] not in self._closed

    def stop(self, k: int, stage: int) -> None:
        """Ends a candidate at a stage at which it has no continuation."""
        self.stage[k], self.open[k] = stage, False

    def block(self, k: int, stage: int, q: Array, moved_W: Array, upper: float) -> None:
        """Ends a candidate at a stage at which it collides.

        Args:
            k: its index.
            stage: the stage.
            q: (n,) the colliding arm positions.
            moved_W: (3,) displacement of the target there [m].
            upper: upper bound of the clearance there [m].
        """
        self.stop(k, stage)
        self._blocked.append((stage, upper, q.copy(), moved_W))

    def close(self, flip: int) -> None:
        """Closes all candidates of one finger assignment, including future ones."""
        self._closed.add(flip)
        self.open[self.flip == flip] = False

    def best(self) -> int | None:
        """Index of the cheapest candidate that may be proposed; None if there is none."""
        which = np.flatnonzero(self.open)
        return int(which[self.cost[which].argmin()]) if len(which) else None

    def blocking(self, stage: int, count: int) -> tuple[Array, Array]:
        """Arm positions (K, n) in collision at a stage, the nearest to being free first, and the
        displacements of the target there (K, 3) [m]; K is at most `count`."""
        blocked = sorted((b for b in self._blocked if b[0] == stage), key=lambda b: -b[1])[:count]
        q = np.array([b[2] for b in blocked]).reshape(len(blocked), self.q.shape[-1])
        return q, np.array([b[3] for b in blocked]).reshape(len(blocked), 3)


@dataclass(frozen=True, eq=False)
class FollowedPostures:
    """S postures at grasps, followed along the L poses of the path.

    Attributes:
        q: (S, L, n) arm positions; NaN beyond the end of a chain.
        lower, upper: (S, L) bounds of the clearance [m]; infinite where not measured.
        stage: (S,) stage at which a posture failed, or `COMPLETE_CHAIN`.
    """

    q: Array
    lower: Array
    upper: Array
    stage: Indices

    def blocked_pose(self, s: int) -> int | None:
        """Index of the pose at which posture `s` is deepest in collision; None if it is free."""
        worst = int(self.upper[s].argmin())
        return None if self.upper[s, worst] > 0.0 else worst


SEGMENT_STAGES = (
    (APPROACH, Outcome.APPROACH_LINE),
    (RETREAT, Outcome.RETREAT_LINE),
    (LIFT, Outcome.LIFT_LINE),
)
"""The hand's straight segments in order, with the outcome of a failure on each."""


class NumericLineSearch:
    """Searches chains of a serial arm in a scene.

    Args:
        arm: the arm on its own.
        lines: the hand's path.
        proximity: bounds of the arm's clearance.
        home: (n,) home posture; chains that start near it are preferred [rad].
        settings: effort of the search.
        solutions: solves for postures within the joint limits; numerically if None.
        unlimited_solutions: solves for postures without the joint limits; numerically if None.
    """

    def __init__(
        self,
        arm: ArmKinematics,
        hand_path: HandPath,
        proximity: ArmProximity,
        home: Array,
        settings: ReachSettings,
        *,
        solutions: ArmSolutions | None = None,
        unlimited_solutions: ArmSolutions | None = None,
    ) -> None:
        self.arm, self.hand_path, self.proximity = arm, hand_path, proximity
        self.home, self.settings = home, settings
        margin, starts = settings.limit_margin, settings.starts
        self.solutions = solutions or NumericSolutions(arm, margin, starts=starts)
        self.unlimited_solutions = unlimited_solutions or NumericSolutions(
            arm, margin, starts=starts[:1], limited=False
        )
        self.layers, self.at_grasp = hand_path.layers, hand_path.at_grasp

    def lifted(self, height: float) -> NumericLineSearch:
        """See `LineSearch`."""
        return NumericLineSearch(
            self.arm,
            replace(self.hand_path, lift=height),
            self.proximity,
            self.home,
            self.settings,
            solutions=self.solutions,
            unlimited_solutions=self.unlimited_solutions,
        )

    def begin(self, X_AG: Array, clearance: Array) -> _NumericBatch:
        """See `LineSearch`."""
        return _NumericBatch(self, X_AG, clearance)

    def measure(self, q: Array) -> tuple[Array, Array]:
        """Lower bounds of the clearance of postures (S, n), and their decisive clearance (S,) [m];
        see `decisive_clearance`."""
        bounds = self.proximity.bounds(q, hand=False)
        return bounds.lower, decisive_clearance(bounds, self.settings.exact)

    def follow(self, X_AG: Array, q: Array) -> FollowedPostures:
        """Follows postures from the grasp to the pregrasp, and from the grasp along retreat and
        lift. Postures that collide on a segment are not followed any further.

        Args:
            X_AG: (S, 4, 4) grasps in the arm's base frame.
            q: (S, n) postures there.
        """
        count, at_grasp = len(self.layers), self.at_grasp
        at_retreated = self.hand_path.at_retreated
        lower, upper = np.full((2, len(q), count), np.inf)
        followed = np.full((len(q), count, q.shape[1]), np.nan)
        followed[:, at_grasp] = q
        found = FollowedPostures(followed, lower, upper, np.full(len(q), COMPLETE_CHAIN))
        self._measure_followed(found, [at_grasp], GRASP)
        for stage, begin, end in (
            (APPROACH, at_grasp, 0),
            (RETREAT, at_grasp, at_retreated),
            (LIFT, at_retreated, count - 1),
        ):
            step = -1 if end < begin else 1
            poses = range(begin + step, end + step, step)
            for pose in poses:
                self._step(found, X_AG, pose, step, stage, bent=pose - step == begin)
            self._measure_followed(found, poses, stage)
        return found

    def _step(
        self, found: FollowedPostures, X_AG: Array, pose: int, step: int, stage: int, *, bent: bool
    ) -> None:
        """Continues postures to the next pose, starting from an extrapolation of the last two, or
        from the last one where the path is `bent`."""
        alive = np.flatnonzero(found.stage == COMPLETE_CHAIN)
        before = found.q[alive, pose - step]
        start = before
        if not bent:
            start = 2.0 * before - found.q[alive, pose - 2 * step]
        X_AH = self.hand_path.X_AH(X_AG[alive], self.layers[pose])
        q, met = solve_ik_near(self.arm, X_AH, start, self.settings)
        met &= np.abs(q - before).max(axis=1, initial=0.0) <= self.settings.joint_travel
        found.q[alive[met], pose] = q[met]
        found.stage[alive[~met]] = stage

    def _measure_followed(self, found: FollowedPostures, poses: Sequence[int], stage: int) -> None:
        alive = np.flatnonzero(found.stage == COMPLETE_CHAIN)
        if not len(alive) or not len(poses):
            return
        where = np.ix_(alive, np.array(poses))
        lower, upper = self.measure(found.q[where].reshape(-1, found.q.shape[-1]))
        shape = len(alive), len(poses)
        found.lower[where], found.upper[where] = lower.reshape(shape), upper.reshape(shape)
        found.stage[alive[~(found.upper[where] > 0.0).all(axis=1)]] = stage


class _NumericBatch:
    """See `LineSearchBatch`."""

    def __init__(self, search: NumericLineSearch, X_AG: Array, clearance: Array) -> None:
        self._search, self._X_AG = search, X_AG
        self._deviation = np.clip(0.5 * clearance, *search.settings.deviation)
        self._round = np.zeros(len(X_AG), dtype=int)
        self._candidates = [
            ChainCandidates.empty(len(search.layers), len(search.home)) for _ in X_AG
        ]
        self._advance(list(range(len(X_AG))))

    def propose(self, grasps: Sequence[int]) -> list[Chain | None]:
        """See `LineSearch`."""
        found: dict[int, Chain | None] = {}
        left = list(grasps)
        while left:
            best = {g: self._candidates[g].best() for g in left}
            exhausted = [g for g in left if best[g] is None]
            finished = [g for g in exhausted if self._round[g] == self._search.solutions.rounds]
            found.update(dict.fromkeys(finished))
            self._advance([g for g in exhausted if g not in found])
            found.update(self._refine([(g, k) for g, k in best.items() if k is not None]))
            left = [g for g in left if g not in found]
        return [found[g] for g in grasps]

    def refuse(self, grasp: int, chain: Chain, row: int | None) -> None:
        """See `LineSearch`."""
        candidates, k = self._candidates[grasp], chain.place
        if row is None:
            candidates.open[k] = False
            return
        ends = chain.at_grasp, chain.at_retreated, len(chain.q)
        stage = (
            GRASP
            if row in (0, chain.at_grasp)
            else SEGMENT_STAGES[int(np.searchsorted(ends, row))][0]
        )
        candidates.block(k, stage, chain.q[row], chain.moved_W[row], 0.0)

    def close(self, grasp: int, flip: int) -> None:
        """See `LineSearch`."""
        self._candidates[grasp].close(flip)

    def failure(self, grasp: int) -> Failure:
        """See `LineSearch`."""
        search, candidates = self._search, self._candidates[grasp]
        if not len(candidates):
            return self._limit_failure(grasp, search.at_grasp)
        stage = int(candidates.stage[~candidates.open].max(initial=GRASP))
        if stage == GRASP:
            return self._explain(Outcome.ARM_COLLISION, candidates, GRASP)
        if stage == APPROACH:
            return self._explain_no_approach(grasp)
        if stage in (RETREAT, LIFT):
            return self._explain_line(grasp, stage)
        return Failure(Outcome.NO_PATH)

    def _advance(self, grasps: list[int]) -> None:
        """Solves the next round of postures at grasps, and follows the free ones along all
        segments."""
        search = self._search
        for round_index in sorted({int(self._round[g]) for g in grasps}):
            members = [g for g in grasps if self._round[g] == round_index]
            self._round[members] += 1
            X_AG = self._X_AG[members].reshape(-1, 4, 4)
            pose, q = self._postures(X_AG, search.at_grasp, round_index)
            added = [
                self._candidates[g].add(pose[own] % 2, q[own], search.at_grasp)
                for g, own in ((g, pose // 2 == at) for at, g in enumerate(members))
            ]
            self._follow(np.repeat(members, [len(k) for k in added]), np.concatenate(added))

    def _postures(self, X_AG: Array, layer: int, round_index: int) -> tuple[Indices, Array]:
        search = self._search
        X_AH = search.hand_path.X_AH(X_AG, search.layers[layer])
        pose, q = search.solutions.solve(X_AH, round_index)
        return pose, search.arm.wrapped_near(q, search.home)

    def _follow(self, grasp: Indices, k: Indices) -> None:
        """Follows new candidates, by their grasps (S,) and indices (S,), along all segments."""
        search = self._search
        places = list(zip(grasp.tolist(), k.tolist(), strict=True))
        flip = np.array([self._candidates[g].flip[j] for g, j in places], dtype=np.intp)
        q = np.array([self._candidates[g].q[j, search.at_grasp] for g, j in places])
        q = q.reshape(len(k), len(search.home))
        found = search.follow(self._X_AG[grasp, flip], q)
        for s, (g, j) in enumerate(places):
            stage, blocked = int(found.stage[s]), found.blocked_pose(s)
            if stage == COMPLETE_CHAIN:
                self._candidates[g].complete(j, found.q[s], self._cost(found.q[s], found.lower[s]))
            elif blocked is None:
                self._candidates[g].q[j] = found.q[s]
                self._candidates[g].stop(j, stage)
            else:
                moved_W = search.hand_path.target_displacement(
                    self._X_AG[g, flip[s]], search.layers[blocked]
                )
                upper = float(found.upper[s, blocked])
                self._candidates[g].block(j, stage, found.q[s, blocked], moved_W, upper)

    def _cost(self, q: Array, lower: Array) -> float:
        """Cost of a chain: largest joint motion from layer to layer, distance of its start from
        home, and a penalty for postures not proven free."""
        change = np.abs(np.diff(q, axis=0)).max(axis=1).sum()
        start = START_COST * np.abs(q[0] - self._search.home).max()
        return float(change + start + ChainSearchSettings.doubt_cost * (lower <= 0.0).sum())

    def _refine(self, chosen: list[tuple[int, int]]) -> dict[int, Chain]:
        """Chains with a straight hand motion and no known collision, by grasp; excludes the other
        candidates."""
        if not chosen:
            return {}
        search = self._search
        count = len(search.layers)
        grasp = np.array([g for g, _ in chosen])
        flip = np.array([self._candidates[g].flip[k] for g, k in chosen])
        corners = np.array([self._candidates[g].q[k] for g, k in chosen])
        X_AG = self._X_AG[grasp, flip]
        filler = NumericFiller(
            *(search.hand_path, X_AG, corners, search.layers, search.arm, search.settings)
        )
        at = np.linspace(0.0, count - 1.0, (count - 1) * ChainSearchSettings.rows_per_layer + 1)
        rows = straighten_rows(filler, at, self._deviation[grasp, flip])
        lower, upper = search.measure(rows.q)
        chains = {}
        for i, (g, k) in enumerate(chosen):
            chain = self._chain(g, k, rows, rows.slice_of(i), lower, upper)
            if chain is not None:
                chains[g] = chain
        return chains

    def _chain(
        self, grasp: int, k: int, rows: DenseRows, own: slice, lower: Array, upper: Array
    ) -> Chain | None:
        search, candidates = self._search, self._candidates[grasp]
        layer, flip = rows.layer[own], int(candidates.flip[k])
        chain = search.hand_path.chain(self._X_AG[grasp, flip], flip, rows, own, lower, k)
        blocked = ~(upper[own] > 0.0)
        bad = np.flatnonzero(rows.broken[own] | blocked)
        if len(bad):
            ends = search.at_grasp, search.hand_path.at_retreated, len(search.layers)
            on = np.searchsorted(ends, layer[bad])  # index of the segment
            stage, bad = SEGMENT_STAGES[int(on.min())][0], bad[on == on.min()]
            row = bad[upper[own][bad].argmin()]
            if blocked[row]:
                candidates.block(k, stage, chain.q[row], chain.moved_W[row], float(upper[own][row]))
            else:
                candidates.stop(k, stage)
            return None
        return chain

    def _explain_no_approach(self, grasp: int) -> Failure:
        """Why no chain reaches the pregrasp: it has no free posture, or the approach fails."""
        search = self._search
        if search.at_grasp > 0:
            X_AG, rounds = self._X_AG[grasp], range(search.solutions.rounds)
            q = np.concatenate([self._postures(X_AG, 0, round_index)[1] for round_index in rounds])
            if not len(q):
                return self._limit_failure(grasp, 0)
            _, upper = search.measure(q)
            if not (upper > 0.0).any():
                order = np.argsort(-upper, kind="stable")[: ChainSearchSettings.max_explained]
                return Failure(Outcome.ARM_COLLISION, q=q[order], moved_W=np.zeros((len(order), 3)))
        return self._explain_line(grasp, APPROACH)

    def _explain(self, outcome: Outcome, candidates: ChainCandidates, stage: int) -> Failure:
        """Failure with the colliding postures at a stage, the nearest to being free first."""
        q, moved_W = candidates.blocking(stage, ChainSearchSettings.max_explained)
        return Failure(outcome, q=q, moved_W=moved_W)

    def _explain_line(self, grasp: int, stage: int) -> Failure:
        """Failure on a segment: the colliding postures there; without any, the excess over the
        joint limits at the ends of what no candidate reaches, or the reason."""
        outcome, candidates = dict(SEGMENT_STAGES)[stage], self._candidates[grasp]
        found = self._explain(outcome, candidates, stage)
        if len(found.q):
            return found
        path, at_grasp = self._search.hand_path, self._search.at_grasp
        followed = candidates.q[candidates.stage == stage]
        absent = np.flatnonzero(np.isnan(followed[..., 0]).all(axis=0))
        if stage == APPROACH:
            absent = absent[absent < at_grasp]
        else:
            absent = absent[absent > (at_grasp if stage == RETREAT else path.at_retreated)]
            absent = absent[absent <= path.segment_end(int(absent[0]))] if len(absent) else absent
        ends = {*absent[:1].tolist(), *absent[-1:].tolist()}
        excesses = [self._limit_excess(grasp, layer) for layer in ends]
        return Failure.of_line(outcome, max(excesses, default=0.0))

    def _limit_failure(self, grasp: int, layer: int) -> Failure:
        """`JOINT_LIMIT` with the smallest excess, or `NO_IK` if no posture exists without
        limits."""
        excess = self._limit_excess(grasp, layer)
        if excess == np.inf:
            return Failure(Outcome.NO_IK)
        return Failure(Outcome.JOINT_LIMIT, excess=excess)

    def _limit_excess(self, grasp: int, layer: int) -> float:
        """Smallest excess of a posture at a layer over the joint limits [rad or m]; 0 if one within
        the limits is found, infinite if the pose has none even without limits."""
        search = self._search
        X_AH = search.hand_path.X_AH(self._X_AG[grasp], search.layers[layer])
        if any(len(search.solutions.solve(X_AH, k)[1]) for k in range(search.solutions.rounds)):
            return 0.0
        q = np.concatenate(
            [
                search.unlimited_solutions.solve(X_AH, round_index)[1]
                for round_index in range(search.unlimited_solutions.rounds)
            ]
        )
        arm, margin = search.arm, search.settings.limit_margin
        q = arm.wrapped_near(q, 0.5 * (arm.lower + arm.upper))
        beyond = np.maximum(arm.lower + margin - q, q - arm.upper + margin).max(axis=1)
        return max(0.0, float(beyond.min(initial=np.inf)))
