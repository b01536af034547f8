"""Runs a benchmark: observes each scene, asks the planner, and has the grasps judged.

Nothing is judged here: answers become given grasps of a run over many scenes, see `evaluate`. An
interrupted benchmark goes on where it stopped.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.benchmark.answers import AnswerError, PlannedGrasps, read_answer
from burg_drake.benchmark.benchmark_folder import (
    ANSWERS_FOLDER,
    BENCHMARK_FILE,
    CAMERA_COLUMN,
    FRICTION_COLUMN,
    RANK_COLUMN,
    SCENES_FOLDER,
    SCORE_COLUMN,
    SUITE_FILE,
    TRIALS_FOLDER,
    BenchmarkDocument,
    BenchmarkResult,
    BenchmarkTimes,
    Round,
    StoredAnswer,
    answer_path,
    load_result,
    round_folder,
    save_result,
    scene_path,
)
from burg_drake.benchmark.burg_planner import Observation
from burg_drake.benchmark.clearing import ExecutedGrasp, scene_after, scenes_to_clear
from burg_drake.benchmark.planners import GraspPlanner, PlannerError, PlannerLost, open_planner
from burg_drake.benchmark.real_images import RealImages
from burg_drake.benchmark.settings import BenchmarkSettings, Conditions
from burg_drake.benchmark.suite import HASH_DIGITS, Suite, SuiteLike, as_suite
from burg_drake.benchmark.suite_camera import SuiteCamera
from burg_drake.core import (
    Array,
    FolderLock,
    GraspSet,
    InvalidInputError,
    Listener,
    Prefetcher,
    Progress,
    ProgressMeter,
    Reporter,
    Task,
    WorkerDied,
    WorkerPool,
    atomic_folder,
    default_workers,
    ensure_writable_folder,
    list_names,
    one_line,
    portable_reference,
    remove_unfinished,
    software_versions,
)
from burg_drake.evaluation import (
    INSTANCE_COLUMN,
    TRIAL_FRICTION_COLUMN,
    EvaluationSettings,
    Executor,
    LocalExecutor,
    current_command,
    evaluate,
    group_by_instance,
    held_instances,
    judge_again,
    require_second_engine,
)
from burg_drake.formats import Gripper
from burg_drake.geometry import Surface
from burg_drake.grasping import friction_needed, grasp_contacts, jaws_of, suppress_near_grasps
from burg_drake.scene import Scene, load_scene, save_scene
from burg_drake.station import ENGINES, Station, station_gripper


def run_benchmark(
    suite: SuiteLike,
    planner: str,
    folder: str | Path,
    *,
    settings: BenchmarkSettings | None = None,
    images: str | Path | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
    progress: bool | Listener = True,
) -> BenchmarkResult:
    """Benchmarks a planner on a suite, and writes the result.

    Each scene is observed by each camera of the suite, and the planner is asked once for each
    observation. Of an answer the best grasps within the suite's budget are judged, without those
    near a better one on the same object. Verdicts do not depend on the number of workers; the time
    of an answer may, as images are rendered on other processors meanwhile. A planner
    that fails costs the answer to that observation only. The same call continues an interrupted
    one.

    Example::

        result = burg.benchmark.run_benchmark("tabletop", "antipodal", "results/antipodal")
        print(burg.benchmark.measure_all(result)["top_success"])

    Args:
        suite: as loaded, or a reference for `load_suite`.
        planner: see `open_planner`.
        folder: folder of the result; made if need be.
        settings: the defaults if None.
        images: folder of images that a real camera took of the scenes, see `real_images`; only
            these scenes are observed, by one camera. Images are rendered if None.
        workers: number of processes; one per processor if None.
        executor: executor that judges, instead of `workers` processes of this machine.
        progress: True shows a bar on standard error, False nothing; a function gets the events.

    Raises:
        InvalidInputError: bad argument, or the folder holds something else, or another benchmark.
        UnknownNameError: a reference does not exist.
        PlannerError: the planner cannot be opened, or cannot be asked any more; all answers so far
            are kept.
        MissingDependencyError: a renderer or package is missing.
    """
    begun, suite, folder = time.monotonic(), as_suite(suite), Path(folder)
    settings = settings or BenchmarkSettings()
    if executor is None:
        executor = LocalExecutor.of_this_machine(workers)
    elif workers is not None:
        raise InvalidInputError(
            "give either workers or an executor; an executor has workers of its own"
        )
    if not suite.scenes(settings.split):
        raise InvalidInputError(f"{suite.path} has no scenes of split {settings.split!r}")
    photos = None if images is None else _open_images(images, suite, settings)
    changes = settings.conditions.changes
    if "depth_noise" in changes and not all(camera.noise for camera in suite.document.cameras):
        raise InvalidInputError(
            f"the depth of suite {suite.name} has no noise that could be multiplied by"
            f" {changes['depth_noise']:g}; choose a suite whose cameras have noise"
        ).about("depth_noise")
    if settings.settle:
        require_second_engine(settings.settle, ENGINES[suite.document.engine], suite.document.mode)
    with open_planner(
        planner,
        time_limit=suite.document.budget.seconds,
        limit_source=f"the budget `seconds` of suite {suite.name}",
    ) as opened:
        document = BenchmarkDocument(
            command=current_command(),
            name=_require_method_name(settings.name or opened.name),
            planner=opened.reference,
            planner_content=opened.content,
            suite=suite.name,
            release=suite.document.release,
            suite_hash=suite.hash,
            protocol=settings.protocol,
            split=settings.split,
            depth_only=settings.depth_only,
            settled=settings.settle,
            conditions=settings.conditions,
            images="" if photos is None else photos.content[:HASH_DIGITS],
            photographed=() if photos is None else photos.scenes,
            versions=software_versions(),
        )
        with (
            FolderLock(ensure_writable_folder(folder)),
            Reporter(progress) as reporter,
            WorkerPool(min(executor.workers, default_workers())) as pool,
        ):
            _require_own_folder(folder, document)
            for path in (folder, *folder.glob(f"**/{ANSWERS_FOLDER}")):
                remove_unfinished(path)
            result = _open_result(folder, document, suite)
            call = _BenchmarkCall(result, suite, opened, executor, reporter, begun, pool, photos)
            return call.run(settings.settle or result.document.settled)


def _open_images(folder: str | Path, suite: Suite, settings: BenchmarkSettings) -> RealImages:
    """The images of a real camera.

    Raises:
        InvalidInputError: they cannot be read, or the settings need rendered images.
    """
    if settings.protocol == "clear":
        raise InvalidInputError(
            "a real camera has no images of scenes that are cleared in simulation; choose the"
            " protocol single"
        ).about("images")
    rendered = sorted(
        {"depth_noise", "camera_shift", "camera_turn"} & {*settings.conditions.changes}
    )
    if rendered:
        raise InvalidInputError(
            f"{list_names(rendered)} can be changed in rendered images only; leave out with images"
            " of a real camera"
        ).about("images")
    scenes = suite.scenes(settings.split)
    every = [one.name for one in suite.document.scenes]
    images = RealImages.open(folder, every, depth_unit=settings.depth_unit)
    images = replace(images, scenes=tuple(name for name in images.scenes if name in scenes))
    if not images.scenes:
        raise InvalidInputError(
            f"{folder} has no depth image of a scene of split {settings.split!r}"
        ).about("images")
    for name in images.scenes:  # before the planner is asked
        images.observe(scenes[name], suite.station, color=not settings.depth_only)
    return images


def _require_method_name(name: str) -> str:
    """Refuses names that would break tables."""
    if not name.isprintable() or not 0 < len(name) <= 100:
        raise InvalidInputError(f"the name {name!r} of the method is empty, long or unprintable")
    return name


def _require_own_folder(folder: Path, document: BenchmarkDocument) -> None:
    """Refuses a folder that holds another benchmark, or anything else.

    Raises:
        InvalidInputError: the message says what differs.
    """
    if (folder / BENCHMARK_FILE).exists():
        recorded = load_result(folder).document
        differences = recorded.differences(document)
        if differences:
            raise InvalidInputError(
                f"{folder} already holds another benchmark ({'; '.join(differences)}); delete"
                " it, or choose another folder"
            ).about("folder")
        if recorded.planner_content not in ("", document.planner_content):
            raise InvalidInputError(
                f"planner {document.planner} has changed since the benchmark in {folder} began"
                f" ({recorded.planner_content} there, {document.planner_content} here); delete"
                " it, or choose another folder"
            ).about("folder")
    elif {path.name for path in folder.iterdir()} - {SUITE_FILE, ANSWERS_FOLDER}:
        raise InvalidInputError(
            f"{folder} is not empty, but has no benchmark ({BENCHMARK_FILE} is missing); delete"
            " it, or choose another folder"
        ).about("folder")


def _open_result(folder: Path, document: BenchmarkDocument, suite: Suite) -> BenchmarkResult:
    """The benchmark in a folder, or a new one."""
    if (folder / BENCHMARK_FILE).exists():
        return load_result(folder)
    copy = replace(
        suite.document,
        library=portable_reference(suite.library.root, folder),
        station=portable_reference(suite.station.path, folder),
    )
    (folder / ANSWERS_FOLDER).mkdir(exist_ok=True)
    (folder / SUITE_FILE).unlink(missing_ok=True)  # of a call that was killed here
    return save_result(folder, document, copy)


@dataclass
class _BenchmarkCall:
    """One call of `run_benchmark`."""

    result: BenchmarkResult
    suite: Suite
    planner: GraspPlanner
    executor: Executor
    reporter: Reporter
    begun: float
    pool: WorkerPool
    photos: RealImages | None

    def run(self, settle: str) -> BenchmarkResult:
        """Goes through the rounds, and returns the complete result."""
        before = self.result.document
        document = replace(before, settled=settle, complete=False)
        self.result = save_result(self.result.path, document, self.result.suite)
        first, times = self.result.rounds[0], BenchmarkTimes()
        known = self.suite.scenes(self.result.document.split)
        scenes = {name: known[name] for name in self.result.scene_names}
        for number in itertools.count(1):
            folder = round_folder(self.result.path, number)
            round = replace(first, path=folder, scenes=tuple(scenes))
            times += self._ask(round, scenes, number)
            begun = time.monotonic()
            self._judge(round, scenes, settle)
            scenes = {} if self._is_last(number) else self._next_scenes(round, scenes, number)
            times += BenchmarkTimes(judging=time.monotonic() - begun)
            if not scenes:
                break
        times = replace(times, total=time.monotonic() - self.begun)
        if not before.complete or settle != before.settled:
            document = replace(document, times=document.times + times)
        document = replace(document, complete=True)
        return save_result(self.result.path, document, self.result.suite)

    def _is_last(self, number: int) -> bool:
        if self.result.document.protocol == "single":
            return True
        return number >= self.suite.document.budget.picks

    def _judge(self, round: Round, scenes: Mapping[str, Scene], settle: str) -> None:
        """Has the answers of a round judged."""
        grasps = round.stored_grasps()
        if not grasps.count:
            return

        def show(event: Progress) -> None:
            # The run learns of the grasps of a scene when it begins with it.
            is_judging = event.phase == "judging"
            self.reporter.show(replace(event, total=grasps.count) if is_judging else event)

        campaign = evaluate(
            list(scenes.values()),
            self.suite.station,
            round.path / TRIALS_FOLDER,
            grasps=grasps,
            settings=EvaluationSettings(
                mode=self.suite.document.mode, engine=self.suite.document.engine
            ),
            executor=self.executor,
            progress=show,
        )
        if settle:
            judge_again(
                campaign, engine=settle, executor=self.executor, progress=self.reporter.show
            )

    def _next_scenes(
        self, round: Round, scenes: Mapping[str, Scene], number: int
    ) -> dict[str, Scene]:
        """The scenes of the next round: at rest after the grasps of this one, if not cleared or
        given up. They are written once all are known."""
        folder = round_folder(self.result.path, number + 1)
        if not folder.is_dir():
            work: list[tuple[Scene, ExecutedGrasp]] = []
            found = {name: scenes[name] for name in scenes_to_clear(self.result, number)}
            for answer in self.result.judged_answers(round):
                name, executed = answer.answer.scene, answer.executed
                if executed is not None:
                    grasp = ExecutedGrasp(round.run_folder(name), answer.ids[executed])
                    work.append((scenes[name], grasp))
            for after in self.pool.map(scene_after, work):
                if after.name in found:
                    found[after.name] = after
            found = {name: scene for name, scene in found.items() if scene.instances}
            if not found:
                return {}
            with atomic_folder(folder) as fresh:
                (fresh / ANSWERS_FOLDER).mkdir()
                (fresh / SCENES_FOLDER).mkdir()
                library = portable_reference(self.suite.library.root, folder / SCENES_FOLDER)
                for name, scene in found.items():
                    save_scene(replace(scene.document, library=library), scene_path(fresh, name))
        return {
            name: load_scene(scene_path(folder, name), library=lambda *_: self.suite.library)
            for name in scenes
            if scene_path(folder, name).exists()
        }

    def _ask(self, round: Round, scenes: Mapping[str, Scene], number: int) -> BenchmarkTimes:
        """Asks the planner for the missing answers of a round; returns the times waited."""
        cameras = {camera.name: camera for camera in self.suite.document.cameras}
        missing = {
            name: [
                cameras[camera]
                for camera in round.cameras
                if not answer_path(round.path, name, camera).exists()
            ]
            for name in scenes
        }
        total, rendering, planning = len(round.cases), 0.0, 0.0
        phase = (
            "planning" if self.result.document.protocol == "single" else f"planning image {number}"
        )
        done = total - sum(map(len, missing.values()))
        progress = Progress(phase, done, total, unit="images")
        meter = ProgressMeter(self.reporter.show, progress, phase)
        station, document = self.suite.station, self.result.document
        work = [
            _Rendering(
                scenes[name],
                station,
                tuple(wanted),
                number - 1,
                document.depth_only,
                document.conditions,
                self.photos,
            )
            for name, wanted in missing.items()
            if wanted
        ]
        stored: list[tuple[_Answer, Future[None]]] = []
        before = time.monotonic()
        try:
            for scene, observations in self._observe(work):
                rendering += time.monotonic() - before
                before = time.monotonic()
                for camera, observation in observations.items():
                    answer = self._ask_once(scene, camera, observation, round.path)
                    stored.append((answer, self.pool.submit(_store_answer, answer)))
                    meter.step()
                planning += time.monotonic() - before
                before = time.monotonic()
            for answer, future in stored:
                try:
                    future.result()
                except WorkerDied as error:
                    _store_answer(replace(answer, error=f"the answer cannot be read: {error}"))
        except BaseException:  # the pool is about to end its workers
            for answer, future in stored:
                if not future.done():
                    _store_answer(answer)
            raise
        return BenchmarkTimes(rendering=rendering, planning=planning)

    def _observe(
        self, work: Sequence[_Rendering]
    ) -> Iterator[tuple[Scene, dict[str, Observation]]]:
        """Renders observations in processes, a few scenes ahead of the planner."""
        rendered = Prefetcher(self.pool, work, lambda one: Task(_render, (one,)))
        while (found := rendered.take()) is not None:
            one, observations = found
            if isinstance(observations, BaseException):
                raise observations
            yield one.scene, observations

    def _ask_once(
        self, scene: Scene, camera: str, observation: Observation, folder: Path
    ) -> _Answer:
        """Asks the planner once."""
        begun = time.monotonic()
        found = _Answer(
            scene=scene,
            station=self.suite.station,
            camera=camera,
            observation=replace(observation, color=None, depth=None, segmentation=None),
            count=self.suite.document.budget.grasps,
            friction=self.result.document.conditions.friction,
            folder=folder,
        )
        try:
            raw = self.planner.ask(observation, scene, self.suite.station)
        except PlannerLost:
            raise
        except PlannerError as error:
            return replace(found, error=str(error), seconds=time.monotonic() - begun)
        return replace(found, raw=raw)


@dataclass(frozen=True, kw_only=True)
class _Answer:
    """A planner's answer to an observation, as it came.

    Attributes:
        scene, station, camera: what was observed, and by which camera.
        observation: the observation, without images.
        count: largest number of grasps that are judged.
        friction: friction coefficient of the objects, as a multiple of their own.
        folder: folder of the round.
        raw: the answer; empty if there is none.
        error: why there is none.
        seconds: time until the error [s].
    """

    scene: Scene
    station: Station
    camera: str
    observation: Observation
    count: int
    friction: float
    folder: Path
    raw: Mapping[str, Any] = field(default_factory=dict)
    error: str = ""
    seconds: float = math.nan


def _store_answer(answer: _Answer) -> None:
    """Reads an answer and writes the grasps that are judged; an answer that cannot be used becomes
    one without grasps that has its error."""
    gripper, seconds, error = station_gripper(answer.station), answer.seconds, answer.error
    grasps = _with_columns(GraspSet.create(np.empty((0, 4, 4)), object=""), "", answer.camera)
    for instance in answer.scene.instances.values():  # a damaged mesh is not the planner's fault
        answer.scene.library.surface(instance.object)
    answered = 0
    notes: tuple[str, ...] = ()
    if not error:
        try:
            planned = read_answer(answer.raw, answer.observation, gripper)
            chosen = choose_grasps(answer.scene, planned, gripper, answer.count, answer.camera)
            grasps = with_friction_needed(chosen, answer.scene, answer.station)
            if answer.friction != 1.0:
                grasps = _with_trial_friction(grasps, answer.scene, answer.friction)
            seconds, answered, notes = planned.time, len(planned.score), planned.notes
        except AnswerError as refused:
            error = str(refused)
        except Exception as unexpected:  # of numbers that no grasp can have
            error = f"the answer cannot be judged: {one_line(unexpected)}"
    StoredAnswer(
        scene=answer.scene.name,
        camera=answer.camera,
        grasps=grasps,
        observation=answer.observation.id,
        seconds=seconds,
        answered=answered,
        error=error,
        notes=notes,
    ).save(answer.folder)


@dataclass(frozen=True)
class _Rendering:
    """The observations of a scene that are needed.

    Attributes:
        scene, station: what is observed.
        cameras: the cameras.
        take: number of the image.
        depth_only: whether no colours are rendered.
        conditions: how sensor and calibration differ from the suite.
        photos: images of a real camera; they are rendered if None.
    """

    scene: Scene
    station: Station
    cameras: tuple[SuiteCamera, ...]
    take: int
    depth_only: bool
    conditions: Conditions
    photos: RealImages | None


def _render(work: _Rendering) -> dict[str, Observation]:
    """Observations of a scene by camera."""
    found = {}
    for camera in work.cameras:
        color = camera.color and not work.depth_only
        if work.photos is not None:
            found[camera.name] = work.photos.observe(work.scene, work.station, color=color)
            continue
        rendering = replace(camera, color=color).scene_camera(work.conditions)
        found[camera.name] = rendering.observe(work.scene, work.station, take=work.take)
    return found


def choose_grasps(
    scene: Scene, planned: PlannedGrasps, gripper: Gripper, count: int, camera: str
) -> GraspSet:
    """The best grasps of an answer in the frames of the objects that they hold, best first.

    A grasp near a better one of the same object is left out, as in GraspNet-1Billion's evaluation.

    Args:
        scene: the scene that was observed.
        planned: the answer.
        gripper: the hand.
        count: largest number of grasps.
        camera: name of the camera.
    """
    n = len(planned.score)
    if not n or not scene.instances:
        return _with_columns(GraspSet.create(np.empty((0, 4, 4)), object=""), "", camera)
    places = np.arange(n, 0.0, -1.0)  # equal scores keep the planner's order
    poses = GraspSet.create(
        planned.X_SG,
        object="",
        width=planned.width,
        score=places,
        columns={SCORE_COLUMN: planned.score},
    )
    owner, _ = held_instances(scene, planned.X_SG, gripper)
    parts = [
        part.with_columns(**{INSTANCE_COLUMN: np.full(len(part), name)})
        for name, part in group_by_instance(scene, poses, planned.X_SG, owner).items()
    ]
    grasps = GraspSet.concatenate(parts)
    kept = grasps.select(suppress_near_grasps(grasps, count)[:count])
    return _with_columns(kept, kept.columns[INSTANCE_COLUMN], camera)


def _with_columns(grasps: GraspSet, instance: Array | str, camera: str) -> GraspSet:
    """Grasps, best first, with the columns of an answer."""
    n = len(grasps)
    columns = {
        INSTANCE_COLUMN: np.broadcast_to(np.asarray(instance, dtype=str), (n,)),
        RANK_COLUMN: np.arange(n),
        CAMERA_COLUMN: np.full(n, camera),
        FRICTION_COLUMN: np.full(n, np.nan),
    }
    return grasps.with_columns(**columns)


def with_friction_needed(grasps: GraspSet, scene: Scene, station: Station) -> GraspSet:
    """Grasps with the smallest friction coefficient at which each holds by the geometry of its
    contacts; NaN if the pads do not both touch."""
    jaws = jaws_of(station.hand, station.hand_model, station.packages)
    needed = np.full(len(grasps), np.nan)
    for name in sorted(set(grasps.object.tolist())):
        rows = np.flatnonzero(grasps.object == name)
        surface = Surface.of(scene.library.surface(name))
        needed[rows] = friction_needed(grasp_contacts(surface, grasps.X_OG[rows], jaws))
    return grasps.with_columns(**{FRICTION_COLUMN: needed})


def _with_trial_friction(grasps: GraspSet, scene: Scene, factor: float) -> GraspSet:
    """Grasps with the friction coefficient of their objects times a factor, for their trials."""
    own = [scene.entry(name).friction for name in grasps.columns[INSTANCE_COLUMN].tolist()]
    return grasps.with_columns(**{TRIAL_FRICTION_COLUMN: factor * np.array(own, dtype=float)})
