"""The search for motions of a batch of grasps: chains are proposed, checked, and joined to home.

If no chain remains, the verdict names what Drake's collision checker found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.core import Array, Outcome
from burg_drake.motion.arm_collision import NO_DISPLACEMENT, ArmCollision, Overlap
from burg_drake.motion.edge_checker import EdgeChecker
from burg_drake.motion.home_tree import HomeTree
from burg_drake.motion.line_search import Chain, Failure, LineSearchBatch
from burg_drake.motion.motion_settings import ReachSettings
from burg_drake.motion.reach_verdict import ArmPath, Reach

PROGRESS_ORDER = (
    Outcome.ARM_COLLISION,
    Outcome.APPROACH_LINE,
    Outcome.RETREAT_LINE,
    Outcome.LIFT_LINE,
)
"""Outcomes in order of progress."""


@dataclass(frozen=True, eq=False)
class GraspBatch:
    """Grasps with a free hand path for at least one finger assignment.

    Attributes:
        instance: N names of the targets; "" without one.
        X_WG: (N, 2, 4, 4) grasps in the world with both finger assignments.
        width: (N,) distance between the pads that hold the target [m]; NaN if it is not known.
        clearance: (N, 2) clearance of the hand on its path [m]; negative where it is not free.
        room: (N, 2) the smaller of that clearance and the depth that the held target may still get
            into bodies that it touches or overlaps at the start [m].
    """

    instance: Sequence[str]
    X_WG: Array
    width: Array
    clearance: Array
    room: Array


@dataclass(frozen=True, eq=False)
class Refusal:
    """A row of a chain that Drake has refused.

    Attributes:
        outcome: one of `PROGRESS_ORDER`, the verdict if the search ends here.
        overlap: the deepest overlap at the row; None if the collision lies just before it.
    """

    outcome: Outcome
    overlap: Overlap | None

    @property
    def rank(self) -> tuple[int, float]:
        """Sort key: how far the chain got, then how small the overlap is."""
        depth = np.inf if self.overlap is None else self.overlap.depth
        return PROGRESS_ORDER.index(self.outcome), -depth


class MotionSearch:
    """Searches arm motions for a batch of grasps.

    Args:
        grasps: the grasps.
        search: the search for chains of these grasps.
        tree: paths from home.
        settings: limits of the search.
    """

    def __init__(
        self, grasps: GraspBatch, search: LineSearchBatch, tree: HomeTree, settings: ReachSettings
    ) -> None:
        self._grasps, self._search, self._tree, self._settings = grasps, search, tree, settings
        self._edges: EdgeChecker = tree.edges
        self._collision: ArmCollision = tree.edges.collision
        self._refused = np.zeros(len(grasps.instance), dtype=int)
        self._unconnected = np.zeros(len(grasps.instance), dtype=int)
        self._nearest: dict[int, Refusal] = {}
        for grasp, flip in np.argwhere(grasps.clearance < 0.0):
            search.close(int(grasp), int(flip))

    def run(self) -> list[Reach]:
        """Returns the N verdicts."""
        found: dict[int, Reach] = {}
        left = list(range(len(self._grasps.instance)))
        while left:
            proposed = dict(zip(left, self._search.propose(left), strict=True))
            chains = {grasp: chain for grasp, chain in proposed.items() if chain is not None}
            found |= self._join_to_home(self._select_free(chains))
            for grasp in left:
                if grasp not in found and (grasp not in chains or self._is_exhausted(grasp)):
                    found[grasp] = self._explain_failure(grasp)
            left = [grasp for grasp in left if grasp not in found]
        return [found[grasp] for grasp in range(len(self._grasps.instance))]

    def _is_exhausted(self, grasp: int) -> bool:
        """Whether a grasp has used up its attempts."""
        refused = self._refused[grasp] >= self._settings.chains
        return bool(refused or self._unconnected[grasp] >= self._settings.starts_tried)

    def _select_free(self, chains: dict[int, Chain]) -> dict[int, Chain]:
        """Selects the free chains, and refuses the others."""
        blocked = {g: self._find_doubtful_blocked(g, chain) for g, chain in chains.items()}
        for lift in (False, True):
            left = {grasp: chains[grasp] for grasp in chains if blocked[grasp] is None}
            blocked |= self._find_first_blocked(left, lift=lift)
        for grasp, row in blocked.items():
            if row is not None:
                self._refuse(grasp, chains[grasp], row)
        return {grasp: chain for grasp, chain in chains.items() if blocked[grasp] is None}

    def _find_doubtful_blocked(self, grasp: int, chain: Chain) -> int | None:
        """Row of a chain at which the arm collides, of the rows without a positive lower bound of
        the clearance, which are the most likely to collide."""
        if not self._settings.exact:
            return None
        doubtful = np.flatnonzero(chain.lower <= 0.0)
        for row in doubtful[np.argsort(chain.lower[doubtful], kind="stable")]:
            carried, moved_W, width = self._load(grasp, chain.moved_W[row])
            if not self._collision.is_free(
                chain.q[row], carried=carried, moved_W=moved_W, width=width
            ):
                return int(row)
        return None

    def _load(self, grasp: int, moved_W: Array) -> tuple[str | None, ArrayLike, float]:
        """Carried instance, its displacement (3,) [m] and width [m] for a target displacement of
        `moved_W`; nothing is carried at 0."""
        held = bool(moved_W.any())
        name = self._grasps.instance[grasp] if held else ""
        width = float(self._grasps.width[grasp]) if held else np.nan
        return (name, moved_W, width) if name else (None, NO_DISPLACEMENT, width)

    def _find_first_blocked(self, chains: dict[int, Chain], *, lift: bool) -> dict[int, int | None]:
        """First row of each chain at, or just before, which the arm collides: on the approach, or
        after the grasp if `lift`."""
        rows = {
            grasp: slice(chain.at_grasp, len(chain.q)) if lift else slice(0, chain.at_grasp + 1)
            for grasp, chain in chains.items()
        }
        found = self._edges.first_blocked_each(
            [chain.q[rows[grasp]] for grasp, chain in chains.items()],
            hand=False,
            carried=[(self._grasps.instance[grasp] or None) if lift else None for grasp in chains],
            moved_W=[chain.moved_W[rows[grasp]] for grasp, chain in chains.items()],
            width=[float(self._grasps.width[grasp]) if lift else np.nan for grasp in chains],
            lower=[chain.lower[rows[grasp]] for grasp, chain in chains.items()],
        )
        return {
            grasp: None if row is None else rows[grasp].start + row
            for grasp, row in zip(chains, found, strict=True)
        }

    def _refuse(self, grasp: int, chain: Chain, row: int) -> None:
        """Excludes a chain. If the colliding link is rigid with the hand, no other posture helps,
        and the whole finger assignment is excluded."""
        self._refused[grasp] += 1
        overlaps = self._overlaps_near(grasp, chain, row)
        with_hand = next((overlap for overlap in overlaps if overlap.carried), None)
        if with_hand is not None:
            self._search.close(grasp, chain.flip)
        else:
            self._search.refuse(grasp, chain, row)
        if row in (0, chain.at_grasp) or with_hand is not None:
            outcome = Outcome.ARM_COLLISION
        else:
            outcome = PROGRESS_ORDER[1 + (row > chain.at_grasp) + (row > chain.at_retreated)]
        refusal = Refusal(outcome, with_hand or next(iter(overlaps), None))
        if grasp not in self._nearest or refusal.rank > self._nearest[grasp].rank:
            self._nearest[grasp] = refusal

    def _overlaps_near(self, grasp: int, chain: Chain, row: int) -> list[Overlap]:
        """Overlaps at a row of a chain, the deepest first; if there are none, between it and the
        row before."""
        before = max(row - 1, 0)
        for share in (0.0, 0.5, 0.25, 0.75):
            q = chain.q[row] + share * (chain.q[before] - chain.q[row])
            moved = chain.moved_W[row] + share * (chain.moved_W[before] - chain.moved_W[row])
            carried, moved_W, width = self._load(grasp, moved)
            found = self._collision.overlaps(q, carried=carried, moved_W=moved_W, width=width)
            if found:
                return found
        return []

    def _join_to_home(self, chains: dict[int, Chain]) -> dict[int, Reach]:
        """Verdicts on the free chains that a path joins to home; refuses the others."""
        if not chains:
            return {}
        transfers = self._tree.connect(np.array([c.q[0] for c in chains.values()]))
        found = {}
        for (grasp, chain), transfer in zip(chains.items(), transfers, strict=True):
            if transfer is None:
                self._search.refuse(grasp, chain, None)
                self._unconnected[grasp] += 1
                continue
            grasp_row, lift_row = chain.at_grasp, chain.at_retreated
            hand = float(self._grasps.clearance[grasp, chain.flip])
            path = ArmPath(
                X_WG=self._grasps.X_WG[grasp, chain.flip],
                transfer=transfer,
                approach=chain.q[: grasp_row + 1],
                retreat=chain.q[grasp_row : lift_row + 1] if lift_row > grasp_row else None,
                lift=chain.q[lift_row:],
                clearance=float(self._grasps.room[grasp, chain.flip]),
            )
            clearance = max(0.0, min(hand, float(chain.lower.min())))
            found[grasp] = Reach(None, clearance=clearance, path=path)
        return found

    def _explain_failure(self, grasp: int) -> Reach:
        """Verdict on a grasp without a motion: the failure of the best attempt."""
        if self._unconnected[grasp]:
            return Reach(Outcome.NO_PATH)
        failure, refusal = self._search.failure(grasp), self._nearest.get(grasp)
        rank = _progress_rank(failure.outcome)
        if refusal is not None and refusal.rank[0] > rank:
            return _reach_blocked_by(refusal.outcome, refusal.overlap)
        smallest = self._smallest_overlap(grasp, failure)
        if refusal is not None and refusal.rank[0] == rank:
            smallest = min(
                (overlap for overlap in (smallest, refusal.overlap) if overlap is not None),
                key=lambda overlap: overlap.depth,
                default=None,
            )
            return _reach_blocked_by(refusal.outcome, smallest)
        if smallest is None:
            return Reach(failure.outcome, excess=failure.excess, reason=failure.reason)
        return _reach_blocked_by(failure.outcome, smallest)

    def _smallest_overlap(self, grasp: int, failure: Failure) -> Overlap | None:
        """Deepest overlap at the failure's configuration where it is smallest; None if all are
        free."""
        smallest: Overlap | None = None
        for q, displacement in zip(failure.q, failure.moved_W, strict=True):
            carried, moved_W, width = self._load(grasp, displacement)
            overlaps = self._collision.overlaps(q, carried=carried, moved_W=moved_W, width=width)
            if overlaps and (smallest is None or overlaps[0].depth < smallest.depth):
                smallest = overlaps[0]
        return smallest


def _progress_rank(outcome: Outcome) -> int:
    return PROGRESS_ORDER.index(outcome) if outcome in PROGRESS_ORDER else -1


def _reach_blocked_by(outcome: Outcome, overlap: Overlap | None) -> Reach:
    if overlap is None:
        return Reach(outcome)
    return Reach(outcome, str(overlap), -overlap.depth)
