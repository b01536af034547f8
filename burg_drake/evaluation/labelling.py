"""Labels grasps of the objects of a library, each object by itself: a data set of grasps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from burg_drake.core import (
    Array,
    GraspSet,
    InvalidInputError,
    Listener,
    Pose,
    UnknownNameError,
    ensure_writable_folder,
    make_pose,
    suggest_names,
)
from burg_drake.evaluation.cascade import evaluate
from burg_drake.evaluation.executor import Executor
from burg_drake.evaluation.grasp_sets.input import run_grasps
from burg_drake.evaluation.run_folder import Run
from burg_drake.evaluation.settings import EvaluationSettings
from burg_drake.formats import format_named, success_labels, write_each_object
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import Board, Instance, Scene, SceneDocument, place_objects, save_scene
from burg_drake.simulation import TrialProtocol, height_to_shake
from burg_drake.station import Station, StationLike, as_station, station_gripper

LABELLING_SCENES_FOLDER, LABELLING_RUNS_FOLDER = "scenes", "runs"
"""Folders beside the labelled grasps: the scene of each object, and its run."""


@dataclass(frozen=True, eq=False)
class ObjectLabels:
    """Labelled grasps of one object.

    Attributes:
        object: name of the object.
        run: the run that labelled them.
        success: (N,) 1 if a grasp holds, 0 if not, NaN if it could not be simulated.
        given: (N,) labels that the grasps came with; NaN where there are none.
        path: file of the grasps.
        notes: what the file cannot carry, one sentence each.
    """

    object: str
    run: Run
    success: Array
    given: Array
    path: Path
    notes: tuple[str, ...]


def label_library(
    library: ObjectLibrary,
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

    Each object stands alone on the table, as its mesh stands, or with protocol `shake` is alone in
    the air. Each gets a run of its own, with all outcomes and margins, and a file of its grasps; a
    call on the same folder goes on where an earlier one stopped. With protocol `shake` grasps come
    from all sides, and no limit on motion in the hand applies, as in ACRONYM.

    Example::

        library = burg.load_library("household")
        for labels in burg.grasps.label_library(library, "panda_tabletop", "labels"):
            print(labels.object, labels.success.mean(), labels.path)

    Args:
        library: the objects.
        station: table and hand.
        out: folder for the files of grasps, and for scenes and runs.
        format: format of the files, see `formats.GRASP_FORMATS`; each holds one object.
        grasps: grasps in object frames, to be labelled in place of sampled ones.
        settings: settings of the runs, whose mode is `hand`; `only` has names of objects.
        executor, workers, progress: see `evaluate`.

    Yields:
        The grasps of each object, once its file is written.

    Raises:
        InvalidInputError: a bad argument, an object that cannot stand, or see `evaluate`.
        UnknownNameError: there is no such object or format.
    """
    settings, station, folder = settings or EvaluationSettings(), as_station(station), Path(out)
    names, target = _chosen_objects(library, settings.only, grasps), format_named(format)
    if target.frame != "object":
        raise InvalidInputError(
            f"{target.title} has grasps in the {target.frame} frame, but those of objects are"
            " labelled; give a format with the frame of objects"
        ).about("format")
    settings = replace(settings, mode="hand", only=None)
    if settings.protocol == "shake":
        settings = replace(
            settings, approach_angle_deg=180.0, tilt_limit_deg=180.0, slip_limit_mm=np.inf
        )
    scenes = {name: scene_of_one(library, name, station, settings.protocol) for name in names}
    ensure_writable_folder(folder)
    for name, scene in scenes.items():
        path = folder / LABELLING_SCENES_FOLDER / f"{scene.name}.yaml"
        if not path.exists():
            ensure_writable_folder(path.parent)
            save_scene(scene.document, path)
        run = evaluate(
            place_objects(scene.document, library, path),
            station,
            folder / LABELLING_RUNS_FOLDER / scene.name,
            grasps=None if grasps is None else grasps.select(grasps.object == name),
            settings=settings,
            executor=executor,
            workers=workers,
            progress=progress,
        )
        found = run_grasps(run)
        given = success_labels(run.candidates.grasps)
        ((path, notes),) = write_each_object(
            found, folder, target, station_gripper(station)
        ).items()
        yield ObjectLabels(name, run, success_labels(found), given, path, notes)


SPARE_HEIGHT = 0.1
"""Metres above `height_to_shake`, for boards that do not lie level."""


def scene_of_one(
    library: ObjectLibrary, name: str, station: Station, protocol: TrialProtocol = "lift"
) -> Scene:
    """A scene of one object alone: in the middle of the board, or in the air to be shaken.

    Args:
        library: library of the object.
        name: name of the object.
        station: station on which grasps are executed.
        protocol: protocol of the trials.

    Raises:
        InvalidInputError: the object is fixed, or cannot stand on a table.
        UnknownNameError: there is no such object.
    """
    entry = library.entry(name)
    if entry.is_fixed:
        raise InvalidInputError(f"object {name!r} has no mass, so that no grasp holds it")
    board = Board()
    middle = make_pose(p_AB=(board.size[0] / 2.0, board.size[1] / 2.0, 0.0))
    if protocol == "shake":
        height = height_to_shake(station) - station.document.X_WS.translation[2]
        X_SO = middle @ make_pose(p_AB=(0.0, 0.0, height + SPARE_HEIGHT))
    elif entry.stable_poses:
        X_SO = middle @ entry.X_SO(entry.proposed_pose)
    else:
        raise InvalidInputError(
            f"object {name!r} has no stable pose, so that it cannot be lifted off a table; give"
            " protocol shake, or leave the object out"
        ).about("protocol", "only")
    document = SceneDocument(
        name=name,
        library=str(library.root.resolve()),
        board=board,
        instances=(Instance(object=name, X_SO=Pose.from_matrix(X_SO)),),
    )
    return place_objects(document, library, Path(f"{name}.yaml"))


def _chosen_objects(
    library: ObjectLibrary, only: Iterable[str] | None, grasps: GraspSet | None
) -> list[str]:
    """Names of the objects whose grasps are labelled, in the order of the library."""
    given = None if grasps is None else set(grasps.object.tolist())
    for name in [*(only or ()), *sorted(given or ())]:
        if name not in library.objects:
            raise UnknownNameError(
                f"library {library.name!r} has no object {name!r};"
                f" {suggest_names(name, library.objects)}"
            )
    chosen = set(only) if only is not None else set(library.objects)
    found = [
        name
        for name in library.objects
        if name in chosen
        and (given is None or name in given)
        and (only is not None or not library.entry(name).is_fixed)
    ]
    if not found:
        raise InvalidInputError(f"library {library.name!r} has no objects to label grasps of")
    return found
