"""How long a worker process may take, and how often it may die."""

from __future__ import annotations

from dataclasses import dataclass

from burg_drake.core.workers import TimeLimit


@dataclass(frozen=True)
class WorkerLimits:
    """Limits of an executor.

    Attributes:
        cpu: CPU time for one grasp, or one screening [s]. A trial takes about a second, the slowest
            ones some tens. On a busy machine it takes longer, but not more CPU time.
        build: CPU time to build a judge [s].
        wall: wall time for each of these [s]; ends what waits for ever.
        hopeless: so many grasps of a job in a row that end their workers, with none judged in
            between, end the job.
        false_starts: so many workers in a row that die while they build the judge of a job end it.
    """

    cpu: float = 300.0
    build: float = 1800.0
    wall: float = 3600.0
    hopeless: int = 50
    false_starts: int = 2

    @property
    def of_task(self) -> TimeLimit:
        """Limit of one grasp, or one screening."""
        return TimeLimit(self.cpu, self.wall)

    @property
    def of_build(self) -> TimeLimit:
        """Limit of building a judge."""
        return TimeLimit(self.build, self.wall)
