"""Real trials that were judged again, the causes of disagreement, and the files that record them.

rejudged.csv      one row for each trial: planned, as measured, real; rows can be replayed
rejudged.json     the figures
scenes/NNN.yaml   the scene of trial NNN as it was measured
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from burg_drake.core import (
    Outcome,
    RealOutcome,
    Verdict,
    atomic_write,
    portable_reference,
    wilson_interval,
)
from burg_drake.evaluation import (
    HASH_DIGITS,
    Candidate,
    Columns,
    RecordedTrial,
    Run,
    TrialOrigin,
    trial_columns,
    write_table,
)
from burg_drake.experiment.comparison.compared_runs import unpredictable_outcomes
from burg_drake.experiment.comparison.confusion_matrix import Paired, compare_paired_counts
from burg_drake.experiment.trials.source_runs import grasp_contents
from burg_drake.experiment.trials.trial_sheet import RealTrial, Success, TrialSheet, is_success
from burg_drake.scene import Scene, save_scene

TrialCause = Literal["agreed", "placement", "worsened", "physics", "unpredictable"]
DISAGREEMENT_CAUSES: dict[TrialCause, str] = {
    "agreed": "agreed as planned, and as measured",
    "placement": "disagreed as planned, agree as measured: explained by the placement",
    "worsened": "agreed as planned, disagree as measured: worsened",
    "physics": "disagree either way: left to physics",
    "unpredictable": "failed for reasons that a run of the hand alone cannot predict",
}
"""Meaning of each combination of both verdicts and the real outcome."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Rejudged:
    """A real trial, judged again.

    Attributes:
        number: of the trial.
        run: key of its run in the sheet.
        grasp, instance, object: which grasp on what.
        real: how it ended on the robot.
        planned: what the run found.
        origin: how the run judged.
        candidate: the grasp in the frame of the object as it stood; None if there is no scene.
        scene: as measured; None if it cannot be.
        notes: what was not taken as measured.
        reason: why there is no scene; empty if there is.
        verdict: of judging again.
    """

    number: int
    run: str
    grasp: str
    instance: str
    object: str
    real: RealOutcome
    planned: Outcome
    origin: TrialOrigin
    candidate: Candidate | None = None
    scene: Scene | None = None
    notes: tuple[str, ...] = ()
    reason: str = ""
    verdict: Verdict | None = None

    @property
    def outcome(self) -> Outcome | None:
        """Of judging again; None if it could not be judged."""
        failed = self.verdict is None or self.verdict.outcome is Outcome.SIMULATION_FAILED
        return None if failed or self.verdict is None else self.verdict.outcome

    @property
    def failure_reason(self) -> str:
        """Why it could not be judged; empty if it was."""
        if self.outcome is not None:
            return ""
        return self.reason or (self.verdict.reason if self.verdict else "")

    @cached_property
    def unpredictable(self) -> bool:
        """Whether no verdict of the run's mode could predict how it ended on the robot."""
        approach = self.origin.settings().approach
        return self.real in unpredictable_outcomes(self.origin.mode, approach=approach)

    def is_right(self, success: Success, *, measured: bool) -> bool:
        """Whether the verdict as planned, or as measured, agrees with the robot."""
        verdict = self.outcome if measured else self.planned
        return verdict is not None and is_success(verdict, success) is is_success(
            self.real, success
        )

    def cause(self, success: Success) -> TrialCause | None:
        """What the two verdicts say of the real one; None if it could not be judged again, or not
        as planned."""
        if self.outcome is None or self.planned is Outcome.SIMULATION_FAILED:
            return None
        if self.unpredictable:
            return "unpredictable"
        planned, measured = (self.is_right(success, measured=m) for m in (False, True))
        if planned:
            return "agreed" if measured else "worsened"
        return "placement" if measured else "physics"


@dataclass(frozen=True, eq=False, kw_only=True)
class Rejudging:
    """All trials of a sheet.

    Attributes:
        path: folder with the answers.
        success: what counts as success.
        trials: those with an outcome and a placement.
        skipped: why the others were not judged again, by number.
    """

    path: Path
    success: Success
    trials: tuple[Rejudged, ...]
    skipped: dict[int, str]

    @cached_property
    def judged(self) -> tuple[Rejudged, ...]:
        """Trials that have a planned verdict and one as measured."""
        return tuple(t for t in self.trials if t.cause(self.success) is not None)

    @cached_property
    def causes(self) -> Counter[TrialCause]:
        """Number of trials by what they say."""
        found: Counter[TrialCause] = Counter(dict.fromkeys(DISAGREEMENT_CAUSES, 0))
        found.update(c for t in self.judged if (c := t.cause(self.success)) is not None)
        return found

    @cached_property
    def table(self) -> Counter[tuple[bool, bool, bool]]:
        """Number of trials by success as planned, as measured, and in reality."""
        return Counter(
            (
                is_success(t.planned, self.success),
                t.outcome is not None and is_success(t.outcome, self.success),
                is_success(t.real, self.success),
            )
            for t in self.judged
        )

    @cached_property
    def predictable(self) -> tuple[Rejudged, ...]:
        """Those of them whose outcome a verdict can predict."""
        return tuple(t for t in self.judged if not t.unpredictable)

    def agreement(self, *, measured: bool, every: bool = False) -> tuple[int, float, float]:
        """Number of trials that agree with reality, as planned or as measured, and Wilson's 95 %
        interval of their share.

        Args:
            measured: the verdicts with the objects where they stood, not those as planned.
            every: of all trials, and not only of the predictable ones.
        """
        trials = self.judged if every else self.predictable
        count = sum(trial.is_right(self.success, measured=measured) for trial in trials)
        return count, *wilson_interval(count, len(trials))

    def precision(self, *, measured: bool, every: bool = False) -> tuple[int, int]:
        """Successes among the predicted successes, and how many those are; arguments as those of
        `agreement`."""
        promised = [
            trial
            for trial in (self.judged if every else self.predictable)
            if (verdict := trial.outcome if measured else trial.planned) is not None
            and is_success(verdict, self.success)
        ]
        return sum(is_success(trial.real, self.success) for trial in promised), len(promised)

    @property
    def explained(self) -> tuple[int, int, float, float]:
        """Of the trials that disagree as planned: how many agree as measured, how many there are,
        and Wilson's 95 % interval of the share."""
        count = self.causes["placement"]
        whole = count + self.causes["physics"]
        return count, whole, *wilson_interval(count, whole)

    @cached_property
    def paired(self) -> Paired:
        """McNemar's exact test of which verdicts agree with reality more often: those as measured,
        which come first, or those as planned."""
        of = self.causes
        return compare_paired_counts(of["agreed"], of["placement"], of["worsened"], of["physics"])


def skip_reason(trial: RealTrial, run: Run | None, content: str | None) -> str:
    """Why a trial cannot be judged again in a run; empty if it can.

    Args:
        trial: the trial.
        run: stands for the trial's.
        content: of the grasp that it has by this id; None if it has none.
    """
    if trial.outcome is None:
        return "not carried out yet"
    if not trial.outcome.attempted:
        return trial.outcome.value.replace("_", " ")
    if not any(place.status == "measured" and place.X_SO for place in trial.placement.values()):
        return "placement not measured"
    if run is None:
        return "of another scene"
    if content is None:
        return "grasp not in the run"
    return "" if content == trial.content else "another grasp of this id in the run"


def match_runs_to_sources(sheet: TrialSheet, runs: Sequence[Run]) -> dict[str, Run]:
    """The run that stands for each run of a sheet: itself, or else the run of the same scene that
    has most of the grasps.

    Args:
        sheet: the trials.
        runs: what a folder holds.
    """
    found = {}
    for key, source in sheet.runs.items():
        same = [run for run in runs if run.document.scene.content == source.scene.content]
        if same:
            tried = {t.grasp: t.content for t in sheet.trials if t.run == key}
            found[key] = max(same, key=partial(_match_rank, hash=source.hash, tried=tried))
    return found


def _match_rank(run: Run, hash: str, tried: Mapping[str, str]) -> tuple[bool, int]:
    return run.document.hash == hash, len(grasp_contents(run, tried).items() & tried.items())


REJUDGED_TABLE_FILE = "rejudged.csv"  # Table of the trials that were judged again.


def rejudged_scene_file(trial: Rejudged, folder: Path) -> Path:
    """Where the scene of a trial is written."""
    return folder / "scenes" / f"{trial.number:03d}.yaml"


def write_rejudging(found: Rejudging) -> None:
    """Writes scenes, table and figures.

    Raises:
        InvalidInputError: a file cannot be written.
    """
    for trial in found.trials:
        if trial.scene is not None:
            path = rejudged_scene_file(trial, found.path)
            library = portable_reference(trial.scene.library.root, path.parent)
            path.parent.mkdir(exist_ok=True)
            save_scene(replace(trial.scene.document, library=library), path)
    rows = [row for trial in found.trials if (row := _trial_columns(trial, found)) is not None]
    if rows:
        write_table(found.path / REJUDGED_TABLE_FILE, concatenate_tables(rows))
    atomic_write(found.path / "rejudged.json", json.dumps(rejudging_json(found), indent=1) + "\n")


def _trial_columns(trial: Rejudged, found: Rejudging) -> Columns | None:
    """The table of one trial; nothing of one that no judge has seen."""
    if trial.scene is None or trial.candidate is None or trial.verdict is None:
        return None
    origin = replace(
        trial.origin,
        scene=str(rejudged_scene_file(trial, found.path)),
        scene_content=trial.scene.content[:HASH_DIGITS],
        run="",
    )
    one = RecordedTrial(
        id=trial.grasp,
        instance=trial.instance,
        object=trial.object,
        X_OG=trial.candidate.X_OG,
        width=trial.candidate.width,
        verdict=trial.verdict,
    )
    joints = len(trial.verdict.q_grasp)
    columns = trial_columns([one], origin, instances=list(trial.scene.instances), joints=joints)
    values = {
        "trial": trial.number,
        "real": trial.real.value,
        "planned": trial.planned.value,
        "cause": trial.cause(found.success) or "",
        "notes": "; ".join(trial.notes),
    }
    return {name: np.array([value]) for name, value in values.items()} | columns


def concatenate_tables(tables: list[Columns]) -> Columns:
    """Tables one below the other; what one of them lacks is NaN or empty there."""
    names = dict.fromkeys(name for table in tables for name in table)
    kinds = {n: next(t[n].dtype.kind for t in tables if n in t) for n in names}

    def part(table: Columns, name: str) -> Any:
        if name in table:
            return table[name]
        return np.full(len(table["id"]), "" if kinds[name] == "U" else np.nan)

    return {name: np.concatenate([part(table, name) for table in tables]) for name in names}


def rejudging_json(found: Rejudging) -> dict[str, Any]:
    """The figures as JSON values."""
    count = len(found.predictable)
    return {
        "success": found.success,
        "judged": len(found.judged),
        "unpredictable": found.causes["unpredictable"],
        "agree": {
            name: {"count": right, "of": count, "low": low, "high": high}
            for name, measured in (("planned", False), ("measured", True))
            for right, low, high in [found.agreement(measured=measured)]
        },
        "precision": {
            name: {
                which: dict(zip(("count", "of"), shares, strict=True))
                for which, every in (("all", True), ("predictable", False))
                for shares in [found.precision(measured=measured, every=every)]
            }
            for name, measured in (("planned", False), ("measured", True))
        },
        "causes": {cause: found.causes[cause] for cause in DISAGREEMENT_CAUSES},
        "explained": dict(zip(("count", "of", "low", "high"), found.explained, strict=True)),
        "mcnemar_p": found.paired.p_value,
        "table": [
            {"planned": p, "measured": m, "real": r, "count": n}
            for (p, m, r), n in sorted(found.table.items())
        ],
        "trials": [_trial_json(trial, found) for trial in found.trials],
        "skipped": {str(number): why for number, why in found.skipped.items()},
    }


def _trial_json(trial: Rejudged, found: Rejudging) -> dict[str, Any]:
    return {
        "number": trial.number,
        "run": trial.run,
        "grasp": trial.grasp,
        "object": trial.object,
        "real": trial.real.value,
        "planned": trial.planned.value,
        "measured": None if trial.outcome is None else trial.outcome.value,
        "cause": trial.cause(found.success),
        "why_not": trial.failure_reason,
        "notes": list(trial.notes),
    }
