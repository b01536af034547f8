"""The runs from which the grasps of a trials file were chosen, and checks for changes."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.core import (
    InvalidInputError,
    UnknownNameError,
    check_pose,
    content_hash,
    quote_value,
    suggest_names,
)
from burg_drake.evaluation import HASH_DIGITS, RUN_FILE, Columns, Run, engine_label, load_runs
from burg_drake.experiment.trials.trial_sheet import RealTrial, SourceRun, TrialSheet

Moved = Mapping[str, "str | Path"]


def grasp_content(instance: str, X_OG: ArrayLike, width: float) -> str:
    """Short hash of a grasp: its instance, and the exact bits of its width and its pose in the
    object frame.
    """
    pose = check_pose(X_OG, "X_OG")
    return content_hash(instance, pose, float(width))[:HASH_DIGITS]


def grasp_contents(run: Run, ids: Iterable[str] | None = None) -> dict[str, str]:
    """`grasp_content` of a run's grasps by id; of all grasps if `ids` is None."""
    grasps, instances = run.candidates.grasps, run.candidates.instance
    wanted = None if ids is None else {*ids}
    return {
        id: grasp_content(str(instances[k]), grasps.X_OG[k], float(grasps.width[k]))
        for k, id in enumerate(run.candidates.id)
        if wanted is None or id in wanted
    }


def load_sources(
    sheet: TrialSheet,
    path: str | Path,
    *,
    moved: Moved | None = None,
    only: Collection[str] | None = None,
) -> dict[str, Run]:
    """Opens the runs of a trials file, by key, and checks that they have every tried grasp.

    Args:
        sheet: contents of the trials file.
        path: the trials file, to whose folder paths of runs are relative.
        moved: folders of runs in place of those in the file, by key.
        only: keys of the needed runs; all if None.

    Raises:
        UnknownNameError: `moved` names a run that the trials file does not have.
        InvalidInputError: a folder is missing or holds another run, or a grasp is missing, not
            judged, or changed; the message names the trials file and what to do.
    """
    moved = moved or {}
    for key in moved:
        if key not in sheet.runs:
            raise UnknownNameError(
                f"{path} has no run {quote_value(key)}; {suggest_names(key, sheet.runs)}"
            )
    wanted = sheet.runs if only is None else {k: sheet.runs[k] for k in sheet.runs if k in only}
    found = {key: _load_source(key, source, Path(path), moved) for key, source in wanted.items()}
    for key, run in found.items():
        _check_grasps(run, [t for t in sheet.trials if t.run == key], Path(path))
    return found


def load_source_run(
    sheet: TrialSheet, path: str | Path, key: str, *, moved: Moved | None = None
) -> Run:
    """Opens one run of a trials file, without checks of its grasps; see `load_sources`."""
    return _load_source(key, sheet.runs[key], Path(path), moved or {})


def trial_rows(sheet: TrialSheet, runs: Mapping[str, Run]) -> Columns:
    """Result rows of the trials' grasps, in the order of `sheet.trials`.

    Args:
        sheet: contents of the trials file.
        runs: what `load_sources` returned.

    Returns:
        Columns as in `evaluation.results_table`; missing values are NaN or empty texts. Column
        `run` has the hash of the run.
    """
    names = list(dict.fromkeys(name for run in runs.values() for name in run.results))
    rows = {
        key: {id: row for row, id in enumerate(run.results["id"].tolist())}
        for key, run in runs.items()
    }
    columns: Columns = {}
    for name in names:
        cells = [
            runs[t.run].results[name][rows[t.run][t.grasp]] if name in runs[t.run].results else None
            for t in sheet.trials
        ]
        text = any(isinstance(cell, str) for cell in cells)
        missing = "" if text else np.nan
        columns[name] = np.array([missing if cell is None else cell for cell in cells])
    return columns


def _load_source(key: str, source: SourceRun, path: Path, moved: Moved) -> Run:
    beside = Path(os.path.realpath(path)).parent
    folder = Path(moved[key]) if key in moved else beside / source.path
    if not folder.is_dir():
        raise InvalidInputError(
            f"{path}: run {key!r} is not in {folder}; write its folder into runs.{key}.path, or"
            f" say in which folder it is now"
        ).about("moved")
    runs = load_runs(folder)
    for run in runs:
        if run.document.hash == source.hash:
            return run
    what = f"run {runs[0].document.hash}" if len(runs) == 1 else f"{len(runs)} other runs"
    raise InvalidInputError(
        f"{path}: run {key!r} is {source.hash}, of scene {source.scene.name!r}, but {folder} holds"
        f" {what}, of scene {runs[0].document.scene.name!r}; give the one"
        " that the trials were planned with, or plan them again"
    ).about("moved")


def _check_grasps(run: Run, trials: list[RealTrial], path: Path) -> None:
    """Refuses trials whose grasp differs from the planned one."""
    index = {id: i for i, id in enumerate(run.candidates.id)}
    grasps, instances = run.candidates.grasps, run.candidates.instance
    for trial in trials:
        where = f"{path}: trial {trial.number}"
        i = index.get(trial.grasp)
        if i is None:
            raise InvalidInputError(
                f"{where}: grasp {quote_value(trial.grasp)} is not in {run.path};"
                f" {suggest_names(trial.grasp, index)}"
            )
        instance = str(instances[i])
        content = grasp_content(instance, grasps.X_OG[i], float(grasps.width[i]))
        if (instance, content) != (trial.instance, trial.content):
            raise InvalidInputError(
                f"{where}: grasp {trial.grasp} of {run.path} has changed: it is on "
                f"{instance!r} with content {content}, but was on {trial.instance!r} with"
                f" content {trial.content} when the trials were planned"
            )
        verdict = run.verdicts.get(trial.grasp)
        if verdict is None:
            raise InvalidInputError(
                f"{where}: grasp {trial.grasp} has no verdict in {run.path} any more; run"
                " the command that made the run again"
            )
        if verdict.outcome is not trial.simulated:
            raise InvalidInputError(
                f"{where}: simulated is {trial.simulated}, but {run.path} has "
                f"{verdict.outcome} for grasp {trial.grasp}; restore the run or this line"
            )


def make_source_run(run: Run, folder: Path | None = None) -> SourceRun:
    """The entry of a run in a trials file.

    Args:
        run: the run.
        folder: folder of the trials file; if None the path is absolute.

    Raises:
        InvalidInputError: the run was begun, but has no hash yet.
    """
    document = run.document
    if not document.hash:
        raise InvalidInputError(
            f"{run.path / RUN_FILE} has no hash yet, as the run has only just begun"
        )
    path = run.path.absolute()
    return SourceRun(
        path=str(path) if folder is None else os.path.relpath(path, folder.absolute()),
        hash=document.hash,
        scene=document.scene,
        station=document.station,
        mode=document.mode,
        engine=engine_label(document.engine),
    )
