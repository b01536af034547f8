"""Pairs of a verdict and an outcome for each grasp, the input of all comparison figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from burg_drake.core import Array, InvalidInputError, Outcome, list_names
from burg_drake.evaluation import (
    HASH_DIGITS,
    TEXT_COLUMNS,
    Campaign,
    Columns,
    Run,
    find_robustness_table,
    lifted_shares,
)
from burg_drake.experiment.comparison.compared_runs import ComparedRuns, list_scene_names
from burg_drake.experiment.comparison.confusion_matrix import Flags, Values
from burg_drake.experiment.comparison.margin_calibration import PREDICTOR_COLUMNS
from burg_drake.experiment.comparison.result_table import (
    GRASP_CONTENT_COLUMNS,
    GRASP_KEY_COLUMNS,
    IdColumn,
    ResultTable,
    TextFactor,
)
from burg_drake.experiment.trials.source_runs import grasp_contents
from burg_drake.experiment.trials.trial_sheet import RealTrial, Success, TrialSheet, is_success

PREDICTION_NUMBERS = (*PREDICTOR_COLUMNS, "confidence")
"""Numeric columns of the predicting run."""
PREDICTION_COLUMNS = (
    *(*GRASP_KEY_COLUMNS, *GRASP_CONTENT_COLUMNS, "object", "outcome", "stage", "blocker"),
    *("run", "judged_again", *PREDICTION_NUMBERS),
)
"""Columns of the predicting run."""
MEASURED_MARGINS = tuple(name for name in PREDICTOR_COLUMNS if name != "score")
"""Margins measured in trials, without the score, which belongs to the grasp."""
REFERENCE_COLUMNS = (
    *(*GRASP_KEY_COLUMNS, *GRASP_CONTENT_COLUMNS, "outcome", "stage", "judged_again"),
    *("confidence", *MEASURED_MARGINS),
)
"""Columns of the reference run, whose verdicts count as the truth."""


@dataclass(frozen=True, eq=False)
class VerdictPairs:
    """N grasps with a verdict and an outcome each.

    Attributes:
        id: (N,) ids of the grasps.
        run: (N,) hashes of the runs of the verdicts.
        scene, object: scene and object of each grasp.
        simulated, stage, blocker: the verdict.
        judged_again: engine of the verdict; empty for the run's own engine.
        confidence: (N,) confidences of the verdicts; NaN if there is none.
        ended: actual outcome, of the real trial or of the other run.
        predicted, actual: (N,) whether verdict and outcome are success.
        margins: (N,) margins of the verdicts by name.
    """

    id: IdColumn
    run: TextFactor
    scene: TextFactor
    object: TextFactor
    simulated: TextFactor
    stage: TextFactor
    blocker: TextFactor
    judged_again: TextFactor
    confidence: Array
    ended: TextFactor
    predicted: Flags
    actual: Flags
    margins: Mapping[str, Array]

    def __len__(self) -> int:
        return len(self.predicted)

    def with_margin(self, name: str, values: Array) -> VerdictPairs:
        """A copy with another margin, (N,)."""
        return replace(self, margins={**self.margins, name: values})

    def take(self, rows: Values) -> VerdictPairs:
        """The selected rows, given as indices or a mask."""
        margins = {name: values[rows] for name, values in self.margins.items()}
        columns = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "margins"}
        for name, column in columns.items():
            array = isinstance(column, np.ndarray)
            columns[name] = column[rows] if array else column.take(rows)
        return VerdictPairs(**columns, margins=margins)


def make_pairs(
    verdicts: ResultTable, ended: TextFactor, actual: Flags, success: Success
) -> VerdictPairs:
    """Pairs from rows of results.

    Args:
        verdicts: columns `PREDICTION_COLUMNS`, N rows.
        ended: actual outcome of each row.
        actual: (N,) whether the outcome is success.
        success: criterion of success.
    """
    texts = verdicts.texts
    return VerdictPairs(
        id=verdicts.id,
        run=texts["run"],
        scene=texts["scene_content"],
        object=texts["object"],
        simulated=texts["outcome"],
        stage=texts["stage"],
        blocker=texts["blocker"],
        judged_again=texts["judged_again"],
        confidence=verdicts.numbers["confidence"],
        ended=ended,
        predicted=is_success_verdict(texts["outcome"], success),
        actual=actual,
        margins={name: verdicts.numbers[name] for name in PREDICTOR_COLUMNS},
    )


def is_success_verdict(simulated: TextFactor, success: Success) -> Flags:
    """(N,) whether verdicts count as success."""
    return simulated.where([is_success(Outcome(name), success) for name in simulated.names])


def rows_without_prediction(simulated: TextFactor) -> dict[str, Flags]:
    """Rows whose verdicts predict nothing, by verdict."""
    return {
        outcome.value: simulated.where([name == outcome.value for name in simulated.names])
        for outcome in (Outcome.SIMULATION_FAILED, Outcome.REACHABLE)
        if outcome.value in simulated.names
    }


def predicted_probability(
    runs: ComparedRuns, pairs: VerdictPairs, table: str | Path | None = None
) -> Array | None:
    """Share of a grasp's perturbed repeats that were lifted.

    Args:
        runs: the runs of the verdicts.
        pairs: N verdicts.
        table: table of robustness; tables in the folders of the runs if None.

    Returns:
        (N,) probabilities, NaN for untested grasps; None without a table.

    Raises:
        InvalidInputError: a table cannot be read, or belongs to another run.
    """
    opened = runs.opened
    shares: dict[tuple[str, str], float] = {}
    tables = _find_tables(opened, None if table is None else Path(table))
    for hashes, path in tables:
        shares |= lifted_shares(
            path, hashes, None if isinstance(opened, Campaign) else opened.candidates.id
        )
    if not tables:
        return None
    values = np.full(len(pairs), np.nan)
    tested = {hash for hash, _ in shares}
    rows = np.flatnonzero(pairs.run.where([name in tested for name in pairs.run.names]))
    for row in rows.tolist():
        values[row] = shares.get((pairs.run[row], pairs.id[row]), np.nan)
    return values


def _find_tables(opened: Run | Campaign, table: Path | None) -> list[tuple[set[str], Path]]:
    """Tables of robustness, with the hashes of the runs that each may belong to."""
    folders = {opened.document.hash: opened.path}
    if isinstance(opened, Campaign):
        folders = {state.run: opened.folder(n) for n, state in opened.states.items() if state.run}
    if table is not None:
        return [(set(folders), table)]
    tables = {hash: find_robustness_table(folder) for hash, folder in folders.items()}
    return [({hash}, path) for hash, path in tables.items() if path is not None]


@dataclass(frozen=True, eq=False)
class _TriedTable:
    """A run with the content hashes of its tried grasps by id."""

    run: Run
    contents: dict[str, str]

    @cached_property
    def rows(self) -> dict[str, int]:
        """Indices of the run's result rows by grasp id."""
        return {id: row for row, id in enumerate(self.run.results["id"].tolist())}


def find_result_rows(
    sheet: TrialSheet, path: Path, runs: ComparedRuns
) -> tuple[Columns, dict[int, str]]:
    """Finds the result rows of the tried grasps.

    Args:
        sheet: contents of the trials file.
        path: the trials file, for messages.
        runs: runs of one scene or of many.

    Returns:
        Columns `PREDICTION_COLUMNS` for the trials that have a row, and column `trial` with the
        index of the trial in the file; reasons why other trials have no row, by index.

    Raises:
        InvalidInputError: no trial has a row, or a grasp differs from the planned one.
    """
    tables: dict[str, list[_TriedTable]] = {}
    tried = {trial.grasp for trial in sheet.trials}
    for run in runs.runs_of({source.scene.content for source in sheet.runs.values()}):
        table = _TriedTable(run, grasp_contents(run, tried))
        tables.setdefault(run.document.scene.content, []).append(table)
    found: list[tuple[int, _TriedTable, int]] = []
    missing: dict[int, str] = {}
    for k, trial in enumerate(sheet.trials):
        source = sheet.runs[trial.run]
        of_scene = tables.get(source.scene.content, [])
        with_grasp = [t for t in of_scene if t.contents.get(trial.grasp) == trial.content]
        with_verdict = [t for t in with_grasp if trial.grasp in t.rows]
        if with_verdict:
            with_verdict.sort(key=lambda t: t.run.document.hash != source.hash)
            found.append((k, with_verdict[0], with_verdict[0].rows[trial.grasp]))
        else:
            sources = [t for t in of_scene if t.run.document.hash == source.hash]
            _reject_changed_grasp(trial, sources, path)
            elsewhere = "is not there" if of_scene else "is of another scene"
            missing[k] = "is not judged" if with_grasp else elsewhere
    if not found:
        raise InvalidInputError(_no_tried_grasps_message(sheet, path, runs, missing))
    return _result_columns(found), missing


def _reject_changed_grasp(trial: RealTrial, sources: Sequence[_TriedTable], path: Path) -> None:
    """Refuses a trial if the run that its grasp was chosen from has another grasp with this id."""
    for table in sources:
        content = table.contents.get(trial.grasp)
        if content and content != trial.content:
            raise InvalidInputError(
                f"{path}: trial {trial.number}: grasp {trial.grasp} of {table.run.path}"
                f" has changed: its content is {content}, but was {trial.content} when"
                " the trials were planned"
            )


def _no_tried_grasps_message(
    sheet: TrialSheet, path: Path, runs: ComparedRuns, missing: Mapping[int, str]
) -> str:
    if not sheet.trials:
        return f"{path} has no trials; burg-drake trials plan chooses some"
    sources = sheet.runs.values()
    if set(missing.values()) == {"is of another scene"}:
        theirs = {s.scene.content[:HASH_DIGITS]: s.scene.name for s in sources}
        what = (
            f"{path} is about scene {list_scene_names(theirs)}, but {runs.path} holds"
            f" {list_scene_names(runs.scenes)}"
        )
    else:
        what = f"no grasp of {path} is judged in {runs.path}, which is on the same scene"
    meant = list_names([f"{source.path} ({source.hash})" for source in sources])
    return (
        f"{what}; give the run from which the trials were chosen, {meant}, or one of the same"
        " grasps"
    )


def _result_columns(found: Sequence[tuple[int, _TriedTable, int]]) -> Columns:
    columns: Columns = {"trial": np.array([k for k, _, _ in found], dtype=np.intp)}
    for name in PREDICTION_COLUMNS:
        text = name in TEXT_COLUMNS
        missing = "" if text else np.nan
        cells = [
            t.run.results[name][row] if name in t.run.results else missing for _, t, row in found
        ]
        columns[name] = np.array(cells, dtype=np.str_ if text else float)
    return columns
