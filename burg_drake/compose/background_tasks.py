"""Long tasks in a worker process: settling the scene in simulation, and counting grasps."""

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
"""Takes a task's progress: the share that is done in [0, 1], a short text and, if there is one, a
partial result. Raises `TaskCancelled` if the task was cancelled."""

BackgroundTask = Callable[[ProgressCallback], T]
"""A callable dataclass that a worker runs. It and its result can be pickled. It raises a
`BurgError` on failure."""


class BackgroundJob(Generic[T]):
    """A task that was submitted to a worker.

    Attributes:
        progress: share that is done, in [0, 1], and a short text.
        partial: partial result in the latest report; None if it has none.
        cancelled: whether the job was cancelled.
        done: whether the job has a result or an error, or was cancelled.
        error: why there is no result; None if there is one, or the job is not done.
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
        """The result of the finished job.

        Raises:
            BurgError: the task failed or was cancelled.
        """
        if self.error is not None:
            raise self.error
        return self._result[0]

    def wait(self, timeout: float | None = None) -> T:
        """Waits until the job is done and `on_change` has returned; returns the result.

        Args:
            timeout: [s].

        Raises:
            TimeoutError: the job is not done by then.
            BurgError: the task failed or was cancelled.
        """
        if not self._finished.wait(timeout):
            raise TimeoutError(f"nothing after {timeout:g} s")
        return self.result

    def cancel(self) -> None:
        """Cancels the job, unless it is done."""
        self._cancel(self)

    def report(self, message: tuple[float, str, Any]) -> None:
        """Takes a report of the worker: share done, short text, partial result."""
        if not self.cancelled:
            share, text, self.partial = message
            self.progress = (share, text)
            self._on_change(self)

    def finish(self, result: T | BurgError) -> None:
        """Sets the result or the error, and marks the job as done."""
        if isinstance(result, BurgError):
            self.error = result
        else:
            self._result.append(result)
        self.done = True
        self._on_change(self)
        self._finished.set()


class BackgroundWorker:
    """Runs the task submitted last, in one process that starts with the first task."""

    def __init__(self) -> None:
        self._pool = WorkerPool(1, retries=0)
        self._lock = threading.Lock()
        self._current_job: BackgroundJob[Any] | None = None

    @property
    def process(self) -> int | None:
        """Identifier of the process, if it was started."""
        return next(iter(self._pool.processes), None)

    def submit(
        self,
        task: BackgroundTask[T],
        on_change: Callable[[BackgroundJob[T]], None] = lambda job: None,
    ) -> BackgroundJob[T]:
        """Submits a task; cancels the previous job if it is not done.

        Args:
            task: task to run.
            on_change: called with the job when it reports progress or is done, in a thread of the
                worker.
        """
        job = BackgroundJob(self.cancel, on_change)
        with self._lock:
            older, self._current_job = self._current_job, job
            try:
                job._future = self._pool.submit_task(
                    Task(run_task_in_worker, (task,), on_progress=job.report)
                )
            except RuntimeError:  # the worker was closed
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
            if self._current_job is not None:
                self._current_job.cancelled = True
        self._pool.kill_workers(5.0)  # seconds until the process is killed


def run_task_in_worker(task: BackgroundTask[T]) -> T:
    """Runs a task in a worker; turns a `SystemExit` into a `SimulationError`."""

    def report(share: float, text: str, partial: Any = None) -> None:
        report_progress((share, text, partial))

    try:
        return task(report)
    except SystemExit as error:  # Drake ends some failed checks this way
        raise _simulation_error(error) from error


def _job_result_or_error(job: BackgroundJob[Any], future: Future[Any]) -> Any:
    """The result of a job, or the error that it ended with."""
    if job.cancelled or future.cancelled():
        job.cancelled = True
        return TaskCancelled("this was cancelled")
    error = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, WorkerDied):
        return SimulationError(f"{error}; the scene was not changed, try again")
    return error if isinstance(error, BurgError) else _simulation_error(error)


def _simulation_error(error: BaseException) -> SimulationError:
    return SimulationError(f"this failed: {' '.join(str(error).split()) or type(error).__name__}")


@dataclass(frozen=True)
class SettlingProposal:
    """The settled scene, to be accepted or reverted.

    Attributes:
        start: the scene before settling; accepted only while the session still has it.
        document: the settled scene, without objects that fell off the table.
        displacements: displacement of each object.
        moving: speeds of instances that still move, as text.
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
    """Settles a scene in a worker process.

    Attributes:
        scene: scene to settle.
        station: station of the scene.
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
    """Instances that settling moves further than `distance` [m] or turns by more than
    `angle_deg`."""
    return [
        name
        for name, d in proposal.displacements.items()
        if d.distance > distance or math.degrees(d.angle) > angle_deg
    ]


@dataclass(frozen=True)
class GraspCountTask:
    """Counts the grasps of a scene in a worker process.

    Attributes:
        scene: scene whose grasps are counted.
        station: station of the scene.
        names: names of instances, in the order of counting.
        grasps_per_object: grasps that are sampled for each object.
    """

    scene: Scene
    station: Station
    names: tuple[str, ...]
    grasps_per_object: int

    def __call__(self, report: ProgressCallback) -> Mapping[str, GraspCount]:
        """Counts by instance; each is reported as soon as it is available."""
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
    """Counts the grasps of the latest scene passed to `update`.

    Args:
        station: station of the scenes.
        grasps_per_object: grasps that are sampled for each object.
        on_change: called with the counting job and the revision of its scene when the job reports
            progress or is done, in a thread of the worker.
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
        self._latest_revision = -1

    def update(self, scene: Scene, revision: int, first: tuple[str, ...]) -> None:
        """Starts counting for a changed scene, unless this revision was passed before.

        Args:
            scene: the current scene.
            revision: its number.
            first: instances that are counted first.
        """
        if revision == self._latest_revision:
            return
        self._latest_revision = revision
        if self._timer is not None:
            self._timer.cancel()
        names = tuple(sorted(scene.instances, key=lambda name: name not in first))
        task = GraspCountTask(scene, self._station, names, self._grasps_per_object)
        # after 0.4 s without further changes
        self._timer = threading.Timer(0.4, self._count, (task, revision))
        self._timer.daemon = True
        self._timer.start()

    def close(self) -> None:
        """Stops counting, and ends the worker."""
        self._latest_revision = -1
        if self._timer is not None:
            self._timer.cancel()
        self._worker.close()

    def _count(self, task: GraspCountTask, revision: int) -> None:
        if revision == self._latest_revision:
            self._worker.submit(task, lambda job: self._on_change(job, revision))
