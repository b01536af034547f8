"""Tasks of the worker processes: settling the scene in physics, and counting grasps."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from burg_drake.compose.background_worker import BackgroundJob, BackgroundWorker, ProgressCallback
from burg_drake.core import BurgError
from burg_drake.scene import Scene, SceneDocument
from burg_drake.station import Station

if TYPE_CHECKING:
    from burg_drake.evaluation import GraspCount
    from burg_drake.simulation import Displacement


@dataclass(frozen=True)
class SettlingProposal:
    """What would become of a scene.

    Attributes:
        start: the scene that it is made of; accepted only while the session still has it.
        document: the scene as it would be, without what fell off the table.
        displacements: how far each object came.
        moving: instances that still move, and how fast: in words.
        fallen: instances that fell off the table.
        duration: simulated time [s].
    """

    start: SceneDocument
    document: SceneDocument
    displacements: Mapping[str, Displacement]
    moving: Mapping[str, str]
    fallen: tuple[str, ...]
    duration: float

    label = "settle"


@dataclass(frozen=True)
class SettlingTask:
    """The task of a worker process.

    Attributes:
        scene: to settle.
        station: where it stands.
        time_limit: simulated time allowed [s].
    """

    scene: Scene
    station: Station
    time_limit: float

    def __call__(self, report: ProgressCallback) -> SettlingProposal:
        from burg_drake.simulation import settle_scene

        passed = 0.0

        def progress(time: float, moving: int) -> None:
            nonlocal passed
            passed += time
            report(min(passed / self.time_limit, 1.0), f"{moving} moving after {passed:.1f} s")

        report(0.0, "building the scene")
        settled = settle_scene(
            self.scene, self.station, time_limit=self.time_limit, progress=progress
        )
        moving = {
            name: f"{v.speed * 1e3:.2f} mm/s, {math.degrees(v.turning):.2f} deg/s"
            for name, v in settled.moving.items()
        }
        return SettlingProposal(
            self.scene.document,
            settled.scene.document,
            dict(settled.displacements),
            moving,
            settled.fallen,
            settled.duration,
        )


def names_of_moved_instances(
    proposal: SettlingProposal, distance: float = 5e-4, angle_deg: float = 0.1
) -> list[str]:
    """Instances that would move further, or turn by more, than given [m, degrees]."""
    return [
        name
        for name, d in proposal.displacements.items()
        if d.distance > distance or math.degrees(d.angle) > angle_deg
    ]


@dataclass(frozen=True)
class GraspCountTask:
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
        from burg_drake.evaluation import grasp_counts

        found: dict[str, GraspCount] = {}
        report(0.0, "counting grasps")
        for name, count in grasp_counts(
            self.scene, self.station, self.names, grasps_per_object=self.grasps_per_object
        ):
            found[name] = count
            report(0.0, f"counting grasps of {name}", {name: count})
        return {name: found[name] for name in self.scene.instances if name in found}


@dataclass(frozen=True)
class GraspCounts:
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
        self, station: Station, grasps_per_object: int, on_counts: Callable[[GraspCounts], None]
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
        task = GraspCountTask(scene, self._station, names, self._grasps_per_object)
        # after 0.4 s without further changes
        self._timer = threading.Timer(0.4, self._count, (task, revision))
        self._timer.daemon = True
        self._timer.start()

    def close(self) -> None:
        """Counts no more."""
        self._newest = -1
        if self._timer is not None:
            self._timer.cancel()
        self._worker.close()

    def _count(self, task: GraspCountTask, revision: int) -> None:
        if revision != self._newest:
            return

        def changed(job: BackgroundJob[Mapping[str, GraspCount]]) -> None:
            if job.cancelled:
                return
            if job.error is not None:
                self._on_counts(GraspCounts(revision, {}, error=job.error))
            elif job.done:
                self._on_counts(GraspCounts(revision, job.result, complete=True))
            elif job.partial is not None:
                self._on_counts(GraspCounts(revision, job.partial))

        self._worker.submit(task, changed)
