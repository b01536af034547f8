"""What executors are given: jobs of grasps, and what they tell of one that they cannot do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from burg_drake.core import BurgError
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.stages import Judge


@dataclass(frozen=True, eq=False)
class Job:
    """Grasps that one judge judges.

    Attributes:
        key: names it among the jobs of a call.
        make_judge: builds the judge; pickled by reference, see `single_job.judge_all`.
        candidates: the grasps.
    """

    key: str
    make_judge: Callable[[], Judge]
    candidates: Sequence[Candidate]


@dataclass(frozen=True, eq=False)
class JobFailed:
    """No more verdicts come for a job, and some of its grasps have none.

    Attributes:
        job: the job.
        error: why: its judge cannot be built, or too many grasps in a row end their workers.
    """

    job: Job
    error: BurgError


OnFailure = Callable[[JobFailed], None]
"""Is told of a job that failed; the others go on."""
