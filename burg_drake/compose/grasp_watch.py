"""Counting grasps beside the editing: a while after each change, in a worker process."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from burg_drake.compose.worker import Job, Worker
from burg_drake.core.errors import BurgError
from burg_drake.scene.scene import Scene
from burg_drake.station.station import Station

if TYPE_CHECKING:
    from burg_drake.evaluation.grasp_counts import GraspCount

PAUSE = 0.4
"""After the last change before grasps are counted [s]."""


@dataclass(frozen=True)
class CountGrasps:
    """The task of a worker process.

    Attributes:
        scene: whose grasps are counted.
        station: where it stands.
        grasps_per_object: grasps that are sampled for each object.
    """

    scene: Scene
    station: Station
    grasps_per_object: int

    def __call__(self, report: Callable[[float, str], None]) -> Mapping[str, GraspCount]:
        from burg_drake.evaluation.grasp_counts import count_grasps

        report(0.0, "counting grasps")
        return count_grasps(self.scene, self.station, grasps_per_object=self.grasps_per_object)


class GraspWatch:
    """Counts the grasps of the newest scene that it was told of.

    Args:
        station: where the scenes stand.
        grasps_per_object: grasps that are sampled for each object.
        on_counts: called with the counts or what is in their way, and the revision, in a thread of
            the worker.
    """

    def __init__(
        self,
        station: Station,
        grasps_per_object: int,
        on_counts: Callable[[Mapping[str, GraspCount] | BurgError, int], None],
    ) -> None:
        self._station, self._grasps_per_object = station, grasps_per_object
        self._on_counts = on_counts
        self._worker = Worker()
        self._timer: threading.Timer | None = None
        self._newest = -1

    def tell(self, scene: Scene, revision: int) -> None:
        """The scene has changed; nothing if this revision is known."""
        if revision == self._newest:
            return
        self._newest = revision
        if self._timer is not None:
            self._timer.cancel()
        self._timer = threading.Timer(PAUSE, self._count, (scene, revision))
        self._timer.daemon = True
        self._timer.start()

    def close(self) -> None:
        """Counts no more."""
        self._newest = -1
        if self._timer is not None:
            self._timer.cancel()
        self._worker.close()

    def _count(self, scene: Scene, revision: int) -> None:
        if revision != self._newest:
            return

        def done(job: Job[Mapping[str, GraspCount]]) -> None:
            if job.done and not job.cancelled:
                self._on_counts(job.error or job.result, revision)

        self._worker.ask(CountGrasps(scene, self._station, self._grasps_per_object), done)
