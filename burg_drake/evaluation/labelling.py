"""Labels grasps of the objects of a library, each object by itself: a data set of grasps."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from burg_drake.core import (
    Array,
    BurgError,
    ClusterError,
    DeviceError,
    GraspSet,
    InvalidInputError,
    Listener,
    MissingDependencyError,
    Pose,
    Progress,
    Reporter,
    SimulationError,
    UnknownNameError,
    WorkerDied,
    WorkerPool,
    ensure_writable_folder,
    inverse,
    list_names,
    make_pose,
    portable_reference,
    suggest_names,
)
from burg_drake.evaluation.campaign_folder import is_campaign
from burg_drake.evaluation.candidates import without_instance
from burg_drake.evaluation.cascade import evaluate, executor_for
from burg_drake.evaluation.executor import Executor, LocalExecutor, keep_workers
from burg_drake.evaluation.grasp_sets.input import run_grasps
from burg_drake.evaluation.judge import require_device
from burg_drake.evaluation.run_folder import RUN_FILE, Run
from burg_drake.evaluation.run_preparation import RunRequest
from burg_drake.evaluation.scene_tasks import PrepareTask, prepare_ahead, preparer_count
from burg_drake.evaluation.settings import EvaluationSettings
from burg_drake.evaluation.trial_origin import protocol_of
from burg_drake.formats import GraspFormat, format_named, success_labels
from burg_drake.objects import LibraryLike, ObjectLibrary, as_library
from burg_drake.scene import (
    Board,
    Instance,
    Scene,
    SceneDocument,
    load_scene,
    place_objects,
    save_scene,
)
from burg_drake.simulation import TrialProtocol, height_to_shake
from burg_drake.station import Station, StationLike, as_engine, as_station, station_gripper

LABELLING_SCENES_FOLDER, LABELLING_RUNS_FOLDER = "scenes", "runs"
"""Folders beside the labelled grasps: the scene of each object, and its run."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ObjectLabels:
    """Labels of the grasps of one object.

    Attributes:
        object: name of the object.
        run: the run that labelled them; None if the object cannot be evaluated.
        success: (N,) 1 if a grasp holds, 0 if not, NaN if it could not be simulated.
        given: (N,) labels that the grasps came with; NaN where there are none.
        path: file of the grasps; None if there are none.
        notes: whether the grasps come from a scene with another pose of the object, and what the
            file cannot carry, one sentence each.
        error: why the object cannot be evaluated; empty if it was.
    """

    object: str
    run: Run | None = None
    success: Array
    given: Array
    path: Path | None = None
    notes: tuple[str, ...] = ()
    error: str = ""


def label_library(
    library: LibraryLike,
    station: StationLike,
    out: str | Path,
    *,
    format: str = "burg_drake",
    grasps: GraspSet | None = None,
    settings: EvaluationSettings | None = None,
    executor: Executor | None = None,
    workers: int | None = None,
    progress: bool | Listener = True,
) -> Iterator[ObjectLabels]:
    """Labels grasps of the objects of a library, object by object.

    Each object stands alone on the table, or with protocol `shake` is alone in the air. Each gets a
    run of its own, with all outcomes and margins, and a file of its grasps; a call on the same
    folder goes on where an earlier one stopped, and writes labels that `runs.judge_again` has
    settled since. With protocol `shake` grasps come from all sides,
    and no limit on motion in the hand applies, as in ACRONYM. An object that cannot be evaluated
    does not stop the others.

    Example::

        for labels in burg.grasps.label_library("household", "panda_tabletop", "labels"):
            print(labels.object, labels.success.mean(), labels.path)

    Args:
        library: the objects; as loaded, or a reference for `load_library`.
        station: table and hand; likewise, for `load_station`.
        out: folder for the files of grasps, and for scenes and runs. Only files of earlier calls
            are replaced.
        format: format of the files, see `formats.GRASP_FORMATS`; each holds one object.
        grasps: grasps in object frames, to be labelled in place of sampled ones.
        settings: settings of the runs, in mode `hand`; `only` has names of objects.
        executor, workers, progress: see `evaluate`.

    Yields:
        The labels of each object, once its file is written.

    Raises:
        InvalidInputError: a bad argument, a setting that has no effect, no object to label, or a
            folder that is a run, or has labels by other settings or other files of these names.
        UnknownNameError: there is no such object or format.
        MissingDependencyError: the engine is not installed.
        DeviceError: the cards fail.
        ClusterError: the cluster is lost.
    """
    settings, station, folder = settings or EvaluationSettings(), as_station(station), Path(out)
    library = as_library(library)
    names, target = _chosen_objects(library, settings.only, grasps), format_named(format)
    if target.frame != "object":
        raise InvalidInputError(
            f"files of {target.title} have grasps in the {target.frame} frame, but those of objects"
            " are labelled; give a format with the frame of objects"
        )
    _require_label_folder(folder, names, target.suffixes[0])
    settings = _labelling_settings(settings)
    request = RunRequest.of(station, settings)
    scenes = _LabelledScenes(library, station, settings.protocol, folder)
    runs = {name: scenes.run_folder(name) for name in names}
    new = [name for name, run_folder in runs.items() if not (run_folder / RUN_FILE).exists()]
    executor = executor_for(executor, workers, settings)
    request = replace(request, local=isinstance(executor, LocalExecutor))
    if request.local and new:
        require_device(as_engine(settings.engine), settings.device)
    ensure_writable_folder(folder)
    with ExitStack() as stack:
        if isinstance(executor, LocalExecutor):
            executor = stack.enter_context(keep_workers(executor))
        sampled = new if grasps is None else []
        sampling = stack.enter_context(_RunSampling(scenes, request, executor.workers, sampled))
        for name, run_folder in runs.items():
            given = None if grasps is None else _grasps_of(grasps, name)
            try:
                sampling.wait_for(name, progress)
                run = evaluate(
                    scenes.scene(name),
                    station,
                    run_folder,
                    grasps=given,
                    settings=settings,
                    executor=executor,
                    progress=progress,
                )
                found = _write_labels(name, run, target, station, folder)
            except BurgError as error:
                if _concerns_all(error):
                    raise
                nothing = np.empty(0)
                found = ObjectLabels(object=name, success=nothing, given=nothing, error=str(error))
            else:
                notes = [] if grasps is None else _pose_notes(grasps, run, name)
                found = replace(found, notes=(*notes, *found.notes))
            yield found


def _write_labels(
    name: str, run: Run, target: GraspFormat, station: Station, folder: Path
) -> ObjectLabels:
    """Writes the grasps of an object's run with their labels."""
    found, file = run_grasps(run), folder / f"{name}{target.suffixes[0]}"
    notes = target.write(found, file, station_gripper(station)) if len(found) else ()
    return ObjectLabels(
        object=name,
        run=run,
        success=success_labels(found),
        given=success_labels(run.candidates.grasps),
        path=file if len(found) else None,
        notes=tuple(notes),
    )


@dataclass(frozen=True)
class _LabelledScenes:
    """Scenes of single objects, and the folders of their runs, in the folder of the labels."""

    library: ObjectLibrary
    station: Station
    protocol: TrialProtocol
    folder: Path

    def run_folder(self, name: str) -> Path:
        """Folder of the run of an object."""
        return self.folder / LABELLING_RUNS_FOLDER / name

    def scene(self, name: str) -> Scene:
        """The scene of an object, whose file is written for a new run.

        Raises:
            InvalidInputError: see `single_object_scene`.
        """
        path = self.folder / LABELLING_SCENES_FOLDER / f"{name}.yaml"
        scene = single_object_scene(self.library, name, self.station, self.protocol, path)
        if not (self.run_folder(name) / RUN_FILE).exists():
            ensure_writable_folder(path.parent)
            save_scene(scene.document, path)
        return scene


class _RunSampling:
    """Samples the grasps of new runs while others are judged; a context that ends the processes."""

    def __init__(
        self, scenes: _LabelledScenes, request: RunRequest, workers: int, names: Sequence[str]
    ) -> None:
        """Sets up the processes, which start when `wait_for` is called.

        Args:
            scenes: scenes of the objects.
            request: the request for all scenes.
            workers: number of workers that judge.
            names: objects with new runs, in the order in which they are waited for.
        """
        self._scenes, self._submitted = scenes, deque[str]()
        count = preparer_count(workers, request.engine)
        self._pool = WorkerPool(count, retries=0, own_group=True)
        is_useful = len(names) > 1 and (workers > 1 or request.engine.parallel)
        tasks = self._tasks(names if is_useful else ())
        self._prepared = prepare_ahead(self._pool, request, tasks)

    def _tasks(self, names: Sequence[str]) -> Iterator[PrepareTask]:
        for name in names:
            with suppress(BurgError):  # raised again when its turn comes
                scene = self._scenes.scene(name)
                self._submitted.append(name)
                yield PrepareTask(name, self._scenes.run_folder(name), scene)

    def wait_for(self, name: str, progress: bool | Listener) -> None:
        """Waits until the run of an object is sampled, if that has begun.

        Most errors are left to `evaluate`, which raises them again.

        Raises:
            SimulationError: the process that sampled it has died.
        """
        ready = self._prepared.ready()  # begins more
        if not self._submitted or self._submitted[0] != name:
            return
        self._submitted.popleft()
        with Reporter(progress) as reporter:
            if not ready:
                reporter.show(Progress("sampling"))
            taken = self._prepared.take()
        if taken is not None and isinstance(taken[1], WorkerDied):
            raise SimulationError(f"its grasps cannot be sampled: {taken[1]}")

    def __enter__(self) -> _RunSampling:
        return self

    def __exit__(self, *error: object) -> None:
        self._pool.kill_workers()


def _concerns_all(error: BurgError) -> bool:
    """Whether an error is not about an object: its folder holds labels by other settings, or what
    judges the grasps is missing or lost."""
    if isinstance(error, (DeviceError, ClusterError, MissingDependencyError)):
        return True
    return not {"out", "device", "engine"}.isdisjoint(error.arguments)


def single_object_scene(
    library: ObjectLibrary, name: str, station: Station, protocol: TrialProtocol, path: Path
) -> Scene:
    """A scene of one object: in the middle of the board, or above it in the air to be shaken.

    On the board it stands in the orientation of its mesh, or else in its most probable stable pose.

    Args:
        library: library of the object.
        name: name of the object.
        station: station on which grasps are executed.
        protocol: protocol of the trials.
        path: file of the scene, to which the reference to the library is relative.

    Raises:
        InvalidInputError: the object is fixed, or cannot stand on a table.
        UnknownNameError: there is no such object.
    """
    entry = library.entry(name)
    if entry.is_fixed:
        raise InvalidInputError(f"object {name!r} has no mass, so that no grasp holds it")
    margin = 0.1  # Metres; the board is as large as the object needs.
    widest = 2.0 * float(np.linalg.norm(np.maximum(np.abs(entry.lower), np.abs(entry.upper))))
    width, depth = (max(side, widest + margin) for side in Board().size)
    board = Board(size=(width, depth))
    middle = make_pose(p_AB=(board.size[0] / 2.0, board.size[1] / 2.0, 0.0))
    if protocol == "shake":
        X_WS = station.document.X_WS.matrix()
        x, y, _ = (X_WS @ middle)[:3, 3]
        X_SO = inverse(X_WS) @ make_pose(p_AB=(x, y, height_to_shake(entry, station)))
    elif entry.stable_poses:
        X_SO = middle @ entry.X_SO(entry.proposed_pose)
    else:
        raise InvalidInputError(
            f"object {name!r} has no stable pose, so that it cannot be lifted off a table; label it"
            " with protocol shake"
        )
    document = SceneDocument(
        name=name,
        library=portable_reference(library.root, path.parent),
        board=board,
        instances=(Instance(object=name, X_SO=Pose.from_matrix(X_SO)),),
    )
    return place_objects(document, library, path)


def _require_label_folder(folder: Path, names: Iterable[str], suffix: str) -> None:
    """Refuses a folder in which labels would replace anything but labels of an earlier call.

    Args:
        folder: folder of the labels; it need not exist.
        names: names of the objects.
        suffix: suffix of the files of grasps.

    Raises:
        InvalidInputError: the folder is a run, or has a file of an object without a run.
    """
    if (folder / RUN_FILE).exists() or is_campaign(folder):
        raise InvalidInputError(
            f"{folder} is the folder of a run; choose another folder for the labels"
        ).about("out")
    runs = folder / LABELLING_RUNS_FOLDER
    files = [f"{name}{suffix}" for name in names if not (runs / name / RUN_FILE).exists()]
    if foreign := [file for file in files if (folder / file).exists()]:
        raise InvalidInputError(
            f"labels would replace {list_names(foreign)} in {folder}, which no earlier call has"
            " written; choose another folder"
        ).about("out")


def _labelling_settings(settings: EvaluationSettings) -> EvaluationSettings:
    """The settings of runs that label grasps.

    Raises:
        InvalidInputError: a setting has no effect.
    """
    if settings.mode not in (None, "hand"):
        raise InvalidInputError(
            f"mode is {settings.mode!r}, but grasps of objects alone are executed by the hand"
            " alone; give mode hand, or leave it out"
        ).about("mode")
    settings = replace(settings, mode="hand", only=None)
    if settings.protocol == "lift":
        return settings
    for name in ("approach_angle_deg", "tilt_limit_deg", "slip_limit_mm"):
        if getattr(settings, name) is not None:
            raise InvalidInputError(
                f"{name} is {getattr(settings, name):g}, but with protocol shake grasps come from"
                " all sides, and an object may move in the hand; leave it out"
            ).about(name)
    return settings


def _pose_notes(grasps: GraspSet, run: Run, name: str) -> list[str]:
    """A note if given grasps come from a scene in which their object stands in another pose."""
    max_angle = 5.0  # Degrees between the directions that are up; a smaller one changes few labels.
    reference = grasps.provenance.get("scene")
    if protocol_of(run.document.trial) != "lift" or not isinstance(reference, str):
        return []
    try:
        before = load_scene(reference)
    except BurgError:  # it is gone, or has changed
        return []
    up_O = run.scene().X_SO(name)[2, :3]
    upright = np.cos(np.radians(max_angle))
    instances = [n for n, instance in before.instances.items() if instance.object == name]
    if all(before.X_SO(n)[2, :3] @ up_O > upright for n in instances):
        return []
    return [
        f"{name}: it stands in another pose than in {reference}, from which its grasps come, so"
        " that labels may differ"
    ]


def _grasps_of(grasps: GraspSet, name: str) -> GraspSet:
    """The grasps of an object, of all its instances."""
    return without_instance(grasps.select(grasps.object == name))


def _chosen_objects(
    library: ObjectLibrary, only: Iterable[str] | None, grasps: GraspSet | None
) -> list[str]:
    """Names of the objects whose grasps are labelled, in the order of the library.

    Raises:
        InvalidInputError: there are none, or names of two differ in case alone.
        UnknownNameError: a name is not in the library.
    """
    given = None if grasps is None else set(grasps.object.tolist())
    for name in [*(only or ()), *sorted(given or ())]:
        if name not in library.objects:
            raise UnknownNameError(
                f"library {library.name!r} has no object {name!r};"
                f" {suggest_names(name, library.objects)}"
            )
    chosen = set(library.objects if only is None else only)
    chosen = chosen if given is None else chosen & given
    found = [n for n, e in library.objects.items() if n in chosen and (only or not e.is_fixed)]
    if not found and only and given is not None:
        raise InvalidInputError(
            f"the given grasps are of {list_names(sorted(given))}, but those of"
            f" {list_names(list(only))} are to be labelled; give grasps of these objects"
        ).about("only", "grasps")
    if not found:
        raise InvalidInputError(f"library {library.name!r} has no objects to label grasps of")
    files: dict[str, str] = {}
    for name in found:
        other = files.setdefault(name.casefold(), name)
        if other != name:
            raise InvalidInputError(
                f"the names of {other!r} and {name!r} differ in case alone, so that their files"
                " would be the same on some machines; rename one of them"
            )
    return found
