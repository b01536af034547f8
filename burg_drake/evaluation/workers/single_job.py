"""Judges the grasps of one job in worker processes of this machine; see `executor`."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import closing

from burg_drake.core.grasps import Verdict
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.stages import Judge
from burg_drake.evaluation.workers.executor import LocalExecutor
from burg_drake.evaluation.workers.job import Job
from burg_drake.evaluation.workers.limits import WorkerLimits


def judge_all(
    candidates: Sequence[Candidate],
    make_judge: Callable[[], Judge],
    *,
    workers: int | None = None,
    limits: WorkerLimits | None = None,
) -> Generator[tuple[Candidate, Verdict], None, None]:
    """Judges grasps in parallel.

    Args:
        candidates: the grasps.
        make_judge: builds the judge, called once in each worker; pickled by reference, hence an
            instance of an importable class or an importable function.
        workers: number of processes; as many as there are processors if None.
        limits: what they may take; the usual ones if None.

    Yields:
        Each candidate with its verdict, in the order of completion. Closing the iterator ends the
        workers.

    Raises:
        InvalidInputError: workers is below 1.
        BurgError: the judge cannot be built.
        SimulationError: workers die while the judge is built, or at `WorkerLimits.hopeless` grasps
            in a row.
    """
    executor = LocalExecutor.of_this_machine(workers, limits)
    with closing(executor.judge([Job("", make_judge, candidates)])) as answers:
        for _, candidate, verdict in answers:
            yield candidate, verdict
