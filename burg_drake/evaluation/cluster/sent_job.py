"""A job of a cluster: what of it waits, and in which chunks it is sent."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.cluster.bundles import Bundle, recipe_of
from burg_drake.evaluation.workers import Job

MOST = 32
"""Grasps of a chunk. Dask takes some milliseconds for each chunk, and what a lost worker had not
returned is judged again."""
DEPTH = 2
"""Chunks that a thread of a worker has: one that it is at, and one that waits."""
LOSSES = 3
"""So many workers are lost at a grasp, at the last ones with nothing beside it, until it is given
up."""


@dataclass(eq=False)
class SentJob:
    """A job under way.

    Attributes:
        job: the job.
        waiting: grasps that no worker has.
        suspects: those among them at which a worker was lost, with the number of workers; each of
            them travels alone.
        sent: number of chunks that workers have.
        false_starts: of children in a row that died while they built the judge.
        crashes_in_a_row: grasps that ended their children since one was judged.
        failed: whether it is given up.
        deliveries: how often its bundle was sent, by the worker's address.
    """

    job: Job
    waiting: deque[Candidate] = field(default_factory=deque)
    suspects: deque[tuple[Candidate, int]] = field(default_factory=deque)
    sent: int = 0
    false_starts: int = 0
    crashes_in_a_row: int = 0
    failed: bool = False
    deliveries: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self.recipe, self.bundle = recipe_of(self.job.make_judge)
        self.waiting.extend(self.job.candidates)

    bundle: Bundle | None = field(init=False, default=None)

    @property
    def left(self) -> int:
        """Number of grasps that no worker has."""
        return len(self.waiting) + len(self.suspects)

    def cut(self, threads: int) -> SentChunk:
        """Takes grasps off for a chunk, fewer as the end comes near.

        Args:
            threads: number of those that share what is left.
        """
        if self.suspects:
            grasp, losses = self.suspects.popleft()
            return SentChunk(self, (grasp,), losses)
        size = min(MOST, -(-len(self.waiting) // (DEPTH * threads)))
        return SentChunk(self, tuple(self.waiting.popleft() for _ in range(size)))

    def give_up(self) -> None:
        """Forgets what is left."""
        self.failed = True
        self.waiting.clear()
        self.suspects.clear()


@dataclass(eq=False)
class SentChunk:
    """Grasps that a worker has.

    Attributes:
        job: of which they are.
        grasps: the grasps.
        losses: workers that were lost at the one grasp.
        future: of Dask.
        done: whether the worker has judged them; the answers may be lost with it nonetheless.
    """

    job: SentJob
    grasps: tuple[Candidate, ...]
    losses: int = 0
    future: Any = None
    done: bool = False

    def take_back(self) -> None:
        """Returns the grasps to their job, as nothing is known of them."""
        if self.job.failed:
            return
        if self.losses:
            self.job.suspects.appendleft((self.grasps[0], self.losses))
        else:
            self.job.waiting.extendleft(reversed(self.grasps))

    def suspect(self, grasps: Sequence[Candidate]) -> Sequence[Candidate]:
        """Returns grasps to their job, as each of them may be why a worker was lost.

        Returns:
            Those with which that has happened too often.
        """
        if self.job.failed:
            return ()
        if self.losses + 1 >= LOSSES:
            return grasps
        self.job.suspects.extend((grasp, self.losses + 1) for grasp in grasps)
        return ()
