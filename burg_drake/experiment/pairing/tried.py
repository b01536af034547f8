"""The real trials of a sheet in the results of a run, be it theirs or another on the same scenes
with the same grasps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from burg_drake.core import InvalidInputError, listing
from burg_drake.evaluation.records import HASH_DIGITS, TEXT, Columns
from burg_drake.evaluation.store import Run
from burg_drake.experiment.pairing.pairs import NAMES
from burg_drake.experiment.pairing.side import JudgedRuns, named
from burg_drake.experiment.trials import RealTrial, TrialSheet, grasp_content


@dataclass(frozen=True, eq=False)
class _TriedTable:
    """A run with its rows by grasp."""

    run: Run

    @cached_property
    def rows(self) -> dict[str, int]:
        return {id: row for row, id in enumerate(self.run.results["id"].tolist())}

    @cached_property
    def candidates(self) -> dict[str, int]:
        return {id: row for row, id in enumerate(self.run.candidates.id)}

    def content(self, grasp: str) -> str:
        """Hash of a grasp; empty if the run has none of this id."""
        k = self.candidates.get(grasp)
        if k is None:
            return ""
        candidates = self.run.candidates
        instance, grasps = str(candidates.instance[k]), candidates.grasps
        return grasp_content(instance, grasps.X_OG[k], float(grasps.width[k]))


def find_tried(sheet: TrialSheet, path: Path, side: JudgedRuns) -> tuple[Columns, dict[int, str]]:
    """Rows of the results about the grasps that were tried.

    Args:
        sheet: contents of the trials file.
        path: the trials file, for messages.
        side: the run, of one scene or of many.

    Returns:
        Columns `NAMES` for the trials that have a row, with their index in the sheet as `trial`;
        and why others have none, by their index.

    Raises:
        InvalidInputError: none has one, or a grasp is not the one that was planned with.
    """
    tables: dict[str, list[_TriedTable]] = {}
    for run in side.runs_of({source.scene.content for source in sheet.runs.values()}):
        tables.setdefault(run.document.scene.content, []).append(_TriedTable(run))
    found: list[tuple[int, _TriedTable, int]] = []
    missing: dict[int, str] = {}
    for k, trial in enumerate(sheet.trials):
        source = sheet.runs[trial.run]
        there = tables.get(source.scene.content, [])
        holds = [t for t in there if t.content(trial.grasp) == trial.content]
        judged = [t for t in holds if trial.grasp in t.rows]
        if judged:
            judged.sort(key=lambda t: t.run.document.hash != source.hash)
            found.append((k, judged[0], judged[0].rows[trial.grasp]))
        else:
            _refuse_changed(trial, [t for t in there if t.run.document.hash == source.hash], path)
            missing[k] = (
                "is not judged" if holds else "is not there" if there else "is of another scene"
            )
    if not found:
        raise InvalidInputError(_nothing_in_common(sheet, path, side, missing))
    return _columns(found), missing


def _refuse_changed(trial: RealTrial, own: Sequence[_TriedTable], path: Path) -> None:
    """Refuses a trial whose own run has another grasp by its id, or none."""
    for table in own:
        content = table.content(trial.grasp)
        if content and content != trial.content:
            raise InvalidInputError(
                f"{path}: trial {trial.number}: grasp {trial.grasp} of {table.run.path}"
                f" has changed: its content is {content}, but was {trial.content} when"
                " the trials were planned"
            )


def _nothing_in_common(
    sheet: TrialSheet, path: Path, side: JudgedRuns, missing: Mapping[int, str]
) -> str:
    if not sheet.trials:
        return f"{path} has no trials; burg-drake trials plan chooses some"
    sources = sheet.runs.values()
    if set(missing.values()) == {"is of another scene"}:
        theirs = {s.scene.content[:HASH_DIGITS]: s.scene.name for s in sources}
        what = f"{path} is about scene {named(theirs)}, but {side.path} holds {named(side.scenes)}"
    else:
        what = f"no grasp of {path} is judged in {side.path}, which is on the same scene"
    meant = listing([f"{source.path} ({source.hash})" for source in sources])
    return (
        f"{what}; give the run from which the trials were chosen, {meant}, or one of the same"
        " grasps"
    )


def _columns(found: Sequence[tuple[int, _TriedTable, int]]) -> Columns:
    columns: Columns = {"trial": np.array([k for k, _, _ in found], dtype=np.intp)}
    for name in NAMES:
        text = name in TEXT
        missing = "" if text else np.nan
        cells = [
            t.run.results[name][row] if name in t.run.results else missing for _, t, row in found
        ]
        columns[name] = np.array(cells, dtype=np.str_ if text else float)
    return columns
