"""A worker process for what takes long: settling the scene in physics, and counting grasps."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from burg_drake.core import (
    BurgError,
    SimulationError,
    Task,
    TaskCancelled,
    WorkerDied,
    WorkerFuture,
    WorkerPool,
    report_progress,
)
from burg_drake.scene import Scene, SceneDocument
from burg_drake.station import Station

if TYPE_CHECKING:
    from burg_drake.evaluation import GraspCount
    from burg_drake.simulation import Displacement

T = TypeVar("T")

ProgressCallback = Callable[..., None]
"""Takes a task's progress: the share that is done in [0, 1], a word for people and, if there is
one, a partial result. Raises `TaskCancelled` if nobody waits for the result."""

BackgroundTask = Callable[[ProgressCallback], T]
"""What a worker does: a dataclass that can be pickled, as can its result. It raises a `BurgError`
if it cannot be done."""


class BackgroundJob(Generic[T]):
    """Something that was asked of a worker.

    Attributes:
        progress: share that is done, in [0, 1], and a word.
        partial: what came of it since the report before, if it tells.
        cancelled: nobody waits for it any more.
        done: it has a result or an error, or was cancelled.
        error: why it has no result; None if it has, or is not done.
    """

    def __init__(
        self,
        cancel: Callable[[BackgroundJob[T]], None],
        on_change: Callable[[BackgroundJob[T]], None],
    ) -> None:
        self.progress: tuple[float, str] = (0.0, "waiting")
        self.partial: Any = None
        self.cancelled = False
        self.error: BurgError | None = None
        self.done = False
        self._cancel, self._on_change = cancel, on_change
        self._result: list[T] = []
        self._finished = threading.Event()
        self._future: WorkerFuture[T] | None = None

    @property
    def result(self) -> T:
        """What came of it, once it is done.

        Raises:
            BurgError: it cannot be done, or was cancelled.
        """
        if self.error is not None:
            raise self.error
        return self._result[0]

    def wait(self, timeout: float | None = None) -> T:
        """The result, when it is there and who listens has been told.

        Args:
            timeout: [s].

        Raises:
            TimeoutError: it is not there by then.
            BurgError: it cannot be done, or was cancelled.
        """
        if not self._finished.wait(timeout):
            raise TimeoutError(f"nothing after {timeout:g} s")
        return self.result

    def cancel(self) -> None:
        """Ends it; nothing if it is done."""
        self._cancel(self)

    def report(self, message: tuple[float, str, Any]) -> None:
        """The worker has told its progress, a word, and what came of it."""
        if not self.cancelled:
            share, word, self.partial = message
            self.progress = (share, word)
            self._on_change(self)

    def finish(self, result: T | BurgError) -> None:
        """It is done."""
        if isinstance(result, BurgError):
            self.error = result
        else:
            self._result.append(result)
        self.done = True
        self._on_change(self)
        self._finished.set()


class BackgroundWorker:
    """One process, started with the first task, that does what it was asked last."""

    def __init__(self) -> None:
        self._pool = WorkerPool(1, retries=0)
        self._lock = threading.Lock()
        self._newest: BackgroundJob[Any] | None = None

    @property
    def process(self) -> int | None:
        """Identifier of the process, if it was started."""
        return next(iter(self._pool.processes), None)

    def submit(
        self,
        task: BackgroundTask[T],
        on_change: Callable[[BackgroundJob[T]], None] = lambda job: None,
    ) -> BackgroundJob[T]:
        """Asks for something; what it was asked before is cancelled, if that is not done.

        Args:
            task: what to do.
            on_change: called with the job when it is further or done, in a thread of the worker.
        """
        job = BackgroundJob(self.cancel, on_change)
        with self._lock:
            older, self._newest = self._newest, job
            try:
                job._future = self._pool.submit_task(
                    Task(run_task_in_worker, (task,), on_progress=job.report)
                )
            except RuntimeError:  # it was closed
                job.cancelled = True
        if older is not None and not older.done and older._future is not None:
            older.cancelled = True
            older._future.interrupt()
        if job._future is None:
            job.finish(TaskCancelled("this was cancelled"))
        else:
            job._future.add_done_callback(
                lambda future: job.finish(_job_result_or_error(job, future))
            )
        return job

    def cancel(self, job: BackgroundJob[Any]) -> None:
        """See `BackgroundJob.cancel`."""
        with self._lock:
            if job.done or job.cancelled or job._future is None:
                return
            job.cancelled = True
        job._future.terminate()

    def close(self) -> None:
        """Ends the process."""
        with self._lock:
            if self._newest is not None:
                self._newest.cancelled = True
        self._pool.kill_workers(5.0)  # seconds that the process has to end


def run_task_in_worker(task: BackgroundTask[T]) -> T:
    """Does a task in a worker; raises what it raises, for `SystemExit` a `SimulationError`."""

    def report(share: float, word: str, partial: Any = None) -> None:
        report_progress((share, word, partial))

    try:
        return task(report)
    except SystemExit as error:  # Drake ends some failed checks this way
        raise _failure_of(error) from error


def _job_result_or_error(job: BackgroundJob[Any], future: Future[Any]) -> Any:
    """The result of a job, or why there is none."""
    if job.cancelled or future.cancelled():
        job.cancelled = True
        return TaskCancelled("this was cancelled")
    error = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, WorkerDied):
        return SimulationError(f"{error}; the scene was not changed, try again")
    return error if isinstance(error, BurgError) else _failure_of(error)


def _failure_of(error: BaseException) -> SimulationError:
    return SimulationError(f"this failed: {' '.join(str(error).split()) or type(error).__name__}")


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


GraspCountJob = BackgroundJob[Mapping[str, "GraspCount"]]


class GraspWatch:
    """Counts the grasps of the newest scene that it was told of.

    Args:
        station: where the scenes stand.
        grasps_per_object: grasps that are sampled for each object.
        on_change: called with the job that counts and the revision of its scene when it is further
            or done, in a thread of the worker.
    """

    def __init__(
        self,
        station: Station,
        grasps_per_object: int,
        on_change: Callable[[GraspCountJob, int], None],
    ) -> None:
        self._station, self._grasps_per_object = station, grasps_per_object
        self._on_change = on_change
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
        if revision == self._newest:
            self._worker.submit(task, lambda job: self._on_change(job, revision))
