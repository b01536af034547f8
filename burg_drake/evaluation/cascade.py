"""Judges grasps of scenes on a station, stage by stage, and writes a run.

Every grasp goes candidate → clear → reachable → planned → executed, as far as the mode of the run
asks, and ends with exactly one outcome. Each verdict is written at once; the same call on the same
folder continues where an earlier one stopped.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Collection, Generator, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import overload

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    STARTING_PHASE,
    InvalidInputError,
    Listener,
    Outcome,
    Progress,
    ProgressMeter,
    Reporter,
    SimulationError,
    ensure_writable_folder,
    remove_unfinished,
)
from burg_drake.evaluation.campaign_folder import Campaign, is_campaign
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.executor import Executor, Job, LocalExecutor
from burg_drake.evaluation.grasp_sets.mistake_search import given_hints
from burg_drake.evaluation.journal import JOURNAL_FILE, Journal, journal_lines
from burg_drake.evaluation.judge import require_device, starting_note
from burg_drake.evaluation.many_scenes import evaluate_scenes
from burg_drake.evaluation.parallel_sampling import (
    InstanceSampler,
    ParallelSampling,
    samples_in_parallel,
)
from burg_drake.evaluation.part_store import keep_parts
from burg_drake.evaluation.run_document import add_session, begin_session, end_session
from burg_drake.evaluation.run_folder import RUN_FILE, Run, require_run_folder, save_run
from burg_drake.evaluation.run_preparation import (
    GraspsLike,
    RunRequest,
    finish_run,
    next_round,
    open_rows,
    open_run,
    require_judged,
    require_sound,
    resample_run,
    save_sampled,
)
from burg_drake.evaluation.settings import EvaluationSettings
from burg_drake.evaluation.table_file import require_writer
from burg_drake.scene import Scene, SceneLike, as_scene
from burg_drake.station import StationLike, as_engine, as_station


@overload
def evaluate(  # type: ignore[overload-overlap]  # a text is a sequence of texts, too
    scene: SceneLike,
    station: StationLike,
    out: str | Path,
    *,
    grasps: GraspsLike | None = ...,
    settings: EvaluationSettings | None = ...,
    workers: int | None = ...,
    executor: Executor | None = ...,
    retry_failed: bool = ...,
    progress: bool | Listener = ...,
) -> Run: ...


@overload
def evaluate(
    scene: Sequence[SceneLike],
    station: StationLike,
    out: str | Path,
    *,
    grasps: GraspsLike | None = ...,
    settings: EvaluationSettings | None = ...,
    workers: int | None = ...,
    executor: Executor | None = ...,
    retry_failed: bool = ...,
    progress: bool | Listener = ...,
) -> Campaign: ...


def evaluate(
    scene: SceneLike | Sequence[SceneLike],
    station: StationLike,
    out: str | Path,
    *,
    grasps: GraspsLike | None = None,
    settings: EvaluationSettings | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
    retry_failed: bool = False,
    progress: bool | Listener = True,
) -> Run | Campaign:
    """Judges grasps and writes a run, or a run over many scenes.

    Results do not depend on the number of workers or on the order in which they finish. A grasp
    that cannot be simulated ends as `simulation_failed`, and the others go on. An interrupted
    call loses nothing that was judged; the same call goes on from there, and returns at once when
    nothing is left to do. It tries those grasps again whose worker process was ended from outside,
    for example because the memory ran out.

    Example::

        run = burg.evaluate("tabletop_six", "panda_tabletop", "runs/first")
        for id in run.best(3):
            print(id, run.row(id)["outcome"], run.row(id)["pad_force"])
        mine = burg.GraspSet.load("grasps.h5")  # instead of sampled ones
        burg.evaluate("tabletop_six", "panda_tabletop", "runs/mine", grasps=mine)

    Args:
        scene: as loaded, or a reference for `load_scene`; or several of them. Each is judged as it
            is on its own, in a folder of its own, all by the same workers.
        station: likewise, for `load_station`.
        out: folder of the run; made if need be.
        grasps: the user's own grasps in the object frame; nothing is sampled then. A set goes to
            the instances that its column `instance` names, or else to all instances of its objects;
            a mapping has sets by instance, as `read_grasps` returns; a function takes the scene
            and returns such a mapping. Of many scenes each gets the grasps of its own objects.
        settings: which grasps are sampled, and how all are judged; if None the defaults: 100 for
            each object, as far as the station's arm can execute them.
        workers: number of processes; one per processor if None.
        executor: executor that judges, instead of `workers` processes of this machine.
        retry_failed: try all grasps again that an earlier call could not simulate.
        progress: True shows a bar on standard error, False nothing; a function gets the events.

    Returns:
        The complete run. Its `failures` lists grasps that could not be simulated. For several
        scenes a `Campaign`, whose `failed` has the scenes that could not be judged.

    Raises:
        InvalidInputError: bad argument, invalid scene, a mode that needs an arm while the station
            has none or the engine supports none, an arm that overlaps the scene, collides in its
            home posture or does not reach the board, unwritable folder, or a folder that holds
            another run or is being written.
        UnknownNameError: a reference does not exist.
        MissingDependencyError: Parquet, or several scenes, without pyarrow; engine mujoco without
            mujoco.
        SimulationError: the simulation of the scene cannot be built, or an executor ends before
            all grasps are judged.
    """
    settings = settings or EvaluationSettings()
    station = as_station(station)
    executor = executor_for(executor, workers, settings)
    is_new = not (Path(out) / RUN_FILE).exists() and not is_campaign(out)
    if isinstance(executor, LocalExecutor) and is_new:
        require_device(as_engine(settings.engine), settings.device)
    if settings.until_balanced is not None and grasps is not None:
        raise InvalidInputError(
            "until_balanced samples more grasps, but grasps are given; leave out one of the two"
        ).about("until_balanced", "grasps")
    request = RunRequest.of(station, settings, grasps, retry_failed=retry_failed)
    request = replace(request, local=isinstance(executor, LocalExecutor))
    require_writer(request.settings.table)
    if isinstance(scene, (Scene, str, Path)):
        return _evaluate_one(scene, request, Path(out), executor, progress)
    if settings.until_balanced is not None:
        raise InvalidInputError(
            "until_balanced works on one scene at a time, but several are given;"
            " evaluate each by itself: `trials plan` takes the runs together"
        ).about("until_balanced")
    return evaluate_scenes(scene, request, Path(out), executor, progress)


def executor_for(
    executor: Executor | None, workers: int | None, settings: EvaluationSettings
) -> Executor:
    """The given executor, or one with this number of processes.

    Raises:
        InvalidInputError: both are given, the number is below 1, or the settings name a device of
            this machine for another executor.
    """
    if executor is None:
        return LocalExecutor.of_this_machine(workers)
    if workers is not None:
        raise InvalidInputError(
            "give either workers or an executor; an executor has workers of its own"
        )
    if settings.device is not None and not isinstance(executor, LocalExecutor):
        raise InvalidInputError(
            "device names a card of this machine, but the grasps are judged on a cluster; leave"
            " one of the two out"
        ).about("device")
    return executor


def _evaluate_one(
    scene: SceneLike,
    request: RunRequest,
    folder: Path,
    executor: Executor,
    progress: bool | Listener,
) -> Run:
    scene = as_scene(scene)
    request.describe_grasps(scene)
    given = request.given_candidates(scene)  # refuses unfit grasps before the folder is made
    require_run_folder(folder)
    if not (folder / RUN_FILE).exists():
        require_sound(scene, request)
    ensure_writable_folder(folder)
    with Reporter(progress) as reporter, Journal(folder / JOURNAL_FILE) as journal:
        show_sampling = partial(reporter.show, Progress("sampling"))
        sample = not samples_in_parallel(scene, request)
        run = open_run(folder, scene, request, given, show_sampling, sample=sample)
        call = _SceneCall(run, scene, request, executor, reporter, journal)
        remove_unfinished(folder)
        if run.is_sampled:
            call.judge_in_rounds()
        else:
            call.judge_while_sampling()
        run = finish_run(call.run, request.settings.table)
        keep_parts(run)
        return run


@dataclass
class _SceneCall:
    """One call of `evaluate` on one scene; `run` is kept up to date."""

    run: Run
    scene: Scene
    request: RunRequest
    executor: Executor
    reporter: Reporter
    journal: Journal
    _meter: ProgressMeter = field(init=False)
    _judged: Counter[str] = field(init=False)  # Grasps judged in this session, by their device.

    def __post_init__(self) -> None:
        self._make_judge = self.request.judge_factory(self.scene)

    def judge_in_rounds(self) -> None:
        """Judges the open grasps, and samples and judges more until the run is balanced."""
        left = open_rows(self.run, retry_failed=self.request.retry_failed)
        while True:
            if len(left):
                self._judge_rows(left)
            more = next_round(self.run)
            if more is None:
                return
            self.reporter.show(Progress("sampling"))
            self.run = resample_run(
                self.run, more, self.scene, self.request.station, before=self.run
            )
            left = open_rows(self.run, retry_failed=False)

    def judge_while_sampling(self) -> None:
        """Judges the grasps of each instance as soon as they are sampled."""
        known: dict[str, Outcome] = {}
        for _, id, verdict in journal_lines(self.run.path / JOURNAL_FILE):
            known[id] = verdict.outcome
            if verdict.is_open(retry_failed=self.request.retry_failed):
                del known[id]
        outcomes = Counter(known.values())
        event = Progress(
            STARTING_PHASE, len(known), self.run.document.grasps.count, outcomes=outcomes
        )
        with closing(self._jobs_while_sampling(known)) as jobs:
            self._judge(jobs, event, len(known))
        if not self.run.is_sampled:
            raise SimulationError(
                f"the executor of {self.run.path} ended before all grasps were judged; the results"
                " so far are kept: run the same command to continue"
            )
        require_judged(self.run)

    def _jobs_while_sampling(self, known: Collection[str]) -> Generator[Job | None, None, None]:
        """Yields a job for each instance, and writes the grasps once all are sampled.

        Yields None while the next one is not sampled and workers have others to judge.
        """
        handed_out = 0
        sampler = InstanceSampler(self.scene, self.request.station, self.run.document)
        with ParallelSampling(sampler, self.executor.workers) as sampling:
            while True:
                if handed_out > self._judged.total() and not sampling.ready():
                    yield None
                    continue
                part = sampling.next_part()
                if part is None:
                    break
                left = [row for row, id in enumerate(part.id) if id not in known]
                handed_out += len(left)
                yield self._job(part.at(left))
            self.run = save_sampled(self.run, self.scene, sampling.candidates(), sampling.cpu)
        self._meter.expect(len(self.run.candidates))

    def _judge_rows(self, left: NDArray[np.int64]) -> None:
        """Judges grasps of the run, given by their rows."""
        run, total = self.run, len(self.run.assigned_ids)
        outcomes = run.index.count_outcomes(left)
        event = Progress(STARTING_PHASE, total - len(left), total, outcomes=outcomes)
        job = self._job(run.candidates.at(left))
        self._judge([job], event, int(run.index.judged.sum()))
        require_judged(self.run)
        document = replace(self.run.document, hints=given_hints(self.run))
        self.run = save_run(self.run.with_document(document))

    def _job(self, candidates: Sequence[Candidate]) -> Job:
        return Job(self.scene.name, self._make_judge, candidates)

    def _judge(self, jobs: Iterable[Job | None], event: Progress, before: int) -> None:
        """Judges the grasps of jobs, writes each verdict at once, and records the session.

        Args:
            jobs: the jobs.
            event: first event of progress.
            before: number of grasps of the run that have a verdict.
        """
        request, document = self.request, self.run.document
        local = isinstance(self.executor, LocalExecutor)
        note = starting_note(document.engine, request.settings.device) if local else ""
        self._meter = ProgressMeter(self.reporter.show, replace(event, note=note), "judging")
        self._judged = Counter()
        session = begin_session(self.executor.workers, before, request.device_text())
        self.run = save_run(self.run.with_document(add_session(document, session)))
        begun = time.monotonic()
        try:
            with closing(self.executor.judge(jobs)) as verdicts:
                for _, candidate, verdict in verdicts:
                    self.journal.append(candidate.id, verdict)
                    self._judged[verdict.device] += 1
                    self._meter.step(outcome=verdict.outcome)
        finally:
            document = end_session(self.run.document, session.finish(self._judged, begun))
            run = save_run(Run(self.run.path, document))
            self.run = run.with_candidates(self.run.candidates) if self.run.is_sampled else run
