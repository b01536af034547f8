"""An executor without processes, for judges that cost nothing."""

from __future__ import annotations

import random
from collections.abc import Generator, Iterable
from dataclasses import dataclass

from burg_drake.core import BurgError, Verdict
from burg_drake.evaluation import Candidate, Job, JobFailed, OnFailure, judge_grasp


@dataclass
class Inline:
    """Judges in this process, the grasps of each job in an order that a seed gives.

    Attributes:
        seed: of the order.
        stop: after so many grasps it ends, as by Ctrl-C; never if None.
        workers: what it tells.
    """

    seed: int = 0
    stop: int | None = None
    workers: int = 1
    judged: int = 0

    def judge(
        self, jobs: Iterable[Job | None], on_failure: OnFailure | None = None
    ) -> Generator[tuple[Job, Candidate, Verdict], None, None]:
        for job in filter(None, jobs):
            candidates = list(job.candidates)
            random.Random(self.seed).shuffle(candidates)
            try:
                judge = job.make_judge()
            except BurgError as error:
                if on_failure is None:
                    raise
                on_failure(JobFailed(job, error))
                continue
            for candidate in candidates:
                if self.judged == self.stop:
                    raise KeyboardInterrupt
                self.judged += 1
                yield job, candidate, judge_grasp(judge, candidate)
