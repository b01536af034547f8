"""Samples the grasps of a scene in separate processes, instance by instance.

An engine with parallel trials executes grasps faster than one process samples them, so those of the
first instances are judged while others are sampled.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial

from burg_drake.core import (
    GraspSet,
    Prefetcher,
    Session,
    SimulationError,
    Task,
    WorkerDied,
    WorkerPool,
    default_workers,
)
from burg_drake.evaluation.candidates import Candidates, chosen_instances, join_candidates
from burg_drake.evaluation.run_document import RunDocument
from burg_drake.evaluation.run_preparation import (
    RunRequest,
    instances_to_sample,
    sample_instances,
)
from burg_drake.scene import Scene
from burg_drake.station import Station


def samples_in_parallel(scene: Scene, request: RunRequest) -> bool:
    """Whether grasps of a scene are sampled while others are judged.

    False for shards, whose grasps are chosen among all, and for balanced runs, which sample in
    rounds.
    """
    settings = request.settings
    whole = request.grasps is None and request.shard is None and settings.until_balanced is None
    return request.engine.parallel and whole and len(chosen_instances(scene, request.only)) > 1


@dataclass(frozen=True, eq=False)
class InstanceSampler:
    """Samples the grasps of single instances.

    Attributes:
        scene, station, document: see `sample_requested`.
    """

    scene: Scene
    station: Station
    document: RunDocument

    def __call__(self, name: str) -> tuple[GraspSet, float]:
        """The grasps of an instance, and the CPU time that they took [s].

        Raises:
            BurgError: the instance cannot be sampled.
        """
        start = time.process_time()
        found = sample_instances(self.scene, self.station, self.document, [name])
        return found[name], time.process_time() - start


class ParallelSampling:
    """The grasps of a run, sampled instance by instance; a context that ends the processes.

    Attributes:
        cpu: CPU time of the sampling so far [s].
    """

    def __init__(self, sampler: InstanceSampler, workers: int) -> None:
        """Sets up the processes, which start when grasps are asked for.

        Args:
            sampler: samples the grasps of an instance.
            workers: number of workers that judge.
        """
        names = instances_to_sample(sampler.scene, sampler.document)
        count = max(1, min(len(names), workers, default_workers()))
        self._pool = WorkerPool(count, retries=0, own_group=True)
        session = Session("sample", partial(InstanceSampler, **vars(sampler)))
        self._prefetcher: Prefetcher[str, tuple[GraspSet, float]] = Prefetcher(
            self._pool, names, lambda name: Task(InstanceSampler.__call__, (name,), session=session)
        )
        self._parts: dict[str, GraspSet] = {}
        self.cpu = 0.0

    def ready(self) -> bool:
        """Whether `next_part` returns without waiting."""
        return self._prefetcher.ready()

    def next_part(self) -> Candidates | None:
        """Waits for the grasps of the next instance; None if there are no more.

        Raises:
            BurgError: it cannot be sampled.
        """
        taken = self._prefetcher.take()
        if taken is None:
            return None
        name, found = taken
        if isinstance(found, WorkerDied):
            raise SimulationError(
                f"the grasps of {name!r} cannot be sampled: {found}; the results so far are kept:"
                " run the same command to continue"
            ) from found
        if isinstance(found, BaseException):
            raise found
        self._parts[name], cpu = found
        self.cpu += cpu
        return join_candidates({name: self._parts[name]})

    def candidates(self) -> Candidates:
        """All grasps so far, in the order of the instances."""
        return join_candidates(self._parts)

    def __enter__(self) -> ParallelSampling:
        return self

    def __exit__(self, *error: object) -> None:
        self._pool.kill_workers()
