"""Counting grasps beside the editing: a while after each change, in a worker process."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from burg_drake.compose.background.process import BackgroundJob, BackgroundWorker, ProgressCallback
from burg_drake.core import BurgError
from burg_drake.scene.document import Scene
from burg_drake.station.document import Station

if TYPE_CHECKING:
    from burg_drake.evaluation.stages import GraspCount

COUNTING_DELAY = 0.4
"""After the last change before grasps are counted [s]."""


@dataclass(frozen=True)
class CountGrasps:
    """The task of a worker process.

    Attributes:
        scene: whose grasps are counted.
        station: where it stands.
        names: of instances, those first whose counts are wanted first.
        grasps_per_object: grasps that are sampled for each object.
    """

    scene: Scene
    station: Station
    names: tuple[str, ...]
    grasps_per_object: int

    def __call__(self, report: ProgressCallback) -> Mapping[str, GraspCount]:
        """Counts by instance; each is reported as soon as it is known."""
        from burg_drake.evaluation.stages import grasp_counts

        found: dict[str, GraspCount] = {}
        report(0.0, "counting grasps")
        for name, count in grasp_counts(
            self.scene, self.station, self.names, grasps_per_object=self.grasps_per_object
        ):
            found[name] = count
            report(0.0, f"counting grasps of {name}", {name: count})
        return {name: found[name] for name in self.scene.instances if name in found}


@dataclass(frozen=True)
class CountedGrasps:
    """What a watch has found.

    Attributes:
        revision: of the scene.
        counts: by instance, of some or all.
        complete: whether these are all.
        error: why there are no more.
    """

    revision: int
    counts: Mapping[str, GraspCount]
    complete: bool = False
    error: BurgError | None = None


class GraspWatch:
    """Counts the grasps of the newest scene that it was told of.

    Args:
        station: where the scenes stand.
        grasps_per_object: grasps that are sampled for each object.
        on_counts: called with what is found, as it comes, in a thread of the worker.
    """

    def __init__(
        self, station: Station, grasps_per_object: int, on_counts: Callable[[CountedGrasps], None]
    ) -> None:
        self._station, self._grasps_per_object = station, grasps_per_object
        self._on_counts = on_counts
        self._worker = BackgroundWorker()
        self._timer: threading.Timer | None = None
        self._newest = -1

    def update(self, scene: Scene, revision: int, first: tuple[str, ...]) -> None:
        """The scene has changed; nothing if this revision is known.

        Args:
            scene: as it is now.
            revision: its number.
            first: instances whose counts are wanted first.
        """
        if revision == self._newest:
            return
        self._newest = revision
        if self._timer is not None:
            self._timer.cancel()
        names = tuple(sorted(scene.instances, key=lambda name: name not in first))
        task = CountGrasps(scene, self._station, names, self._grasps_per_object)
        self._timer = threading.Timer(COUNTING_DELAY, self._count, (task, revision))
        self._timer.daemon = True
        self._timer.start()

    def close(self) -> None:
        """Counts no more."""
        self._newest = -1
        if self._timer is not None:
            self._timer.cancel()
        self._worker.close()

    def _count(self, task: CountGrasps, revision: int) -> None:
        if revision != self._newest:
            return

        def changed(job: BackgroundJob[Mapping[str, GraspCount]]) -> None:
            if job.cancelled:
                return
            if job.error is not None:
                self._on_counts(CountedGrasps(revision, {}, error=job.error))
            elif job.done:
                self._on_counts(CountedGrasps(revision, job.result, complete=True))
            elif job.partial is not None:
                self._on_counts(CountedGrasps(revision, job.partial))

        self._worker.submit(task, changed)
