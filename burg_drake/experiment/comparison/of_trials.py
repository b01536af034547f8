"""One run or two against trials on the robot."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from burg_drake.core import Array, InvalidInputError, listing
from burg_drake.evaluation.records import Columns
from burg_drake.evaluation.store import Campaign, Run
from burg_drake.experiment.comparison.comparison import Comparison, Coverage
from burg_drake.experiment.comparison.disagreement import disagreements
from burg_drake.experiment.comparison.judge_assessment import Judgement, Strata, judgement
from burg_drake.experiment.comparison.placement_error import offsets, placement_agreement
from burg_drake.experiment.pairing import (
    NAMES,
    NUMBERS,
    Factor,
    JudgedRuns,
    ResultTable,
    VerdictPairs,
    find_tried,
    make_pairs,
    predicted_probability,
    settings_apart,
    settled_side,
    side_of_trials,
    undecided,
    unpredictable_for,
)
from burg_drake.experiment.statistics import PROBABILITY, paired
from burg_drake.experiment.trials import (
    RealTrial,
    Success,
    TrialSheet,
    load_trials,
    succeeded,
)


def compare_trials(
    runs: Sequence[Run | Campaign | str | Path],
    path: Path,
    *,
    success: Success | None,
    placement_limit_mm: float,
    robustness: str | Path | None = None,
    seed: int = 0,
) -> Comparison:
    """Compares one or two runs with the trials of a sheet; see `compare`."""
    sheet = load_trials(path)
    success = success or sheet.selection.success
    sides = [JudgedRuns.load(run) for run in runs]
    found_rows = [find_tried(sheet, path, side) for side in sides]
    tables = [columns for columns, _ in found_rows]
    left_out = _missing([missing for _, missing in found_rows])
    indices = set.intersection(*(set(t["trial"].tolist()) for t in tables))
    chosen, uninformative = _informative(sheet, tables, sorted(indices))
    left_out.update(uninformative)
    if not chosen:
        raise InvalidInputError(_no_outcome_message(path, left_out))
    trials = [sheet.trials[k] for k in chosen]
    found = []
    for side, columns in zip(sides, tables, strict=True):
        pairs = _pairs(trials, columns, chosen, success)
        probability = predicted_probability(side, pairs, robustness if side is sides[0] else None)
        found.append(pairs if probability is None else pairs.with_margin(PROBABILITY, probability))
    scenes = [sheet.runs[trial.run].scene.content for trial in trials]
    instances = sides[0].instances_of(set(scenes))
    there = offsets(trials, [instances[scene] for scene in scenes], placement_limit_mm)
    judged = [
        _judgement(pairs, side, sheet, trials, there, placement_limit_mm, seed)
        for pairs, side in zip(found, sides, strict=True)
    ]
    two = len(sides) == 2
    asked = [
        settled_side(side.side, pairs.judged_again)
        for pairs, side in zip(found, sides, strict=True)
    ]
    right = [pairs.predicted == pairs.actual for pairs in found]
    strata = strata_of(sheet, trials)
    return Comparison(
        kind="simulators" if two else "trials",
        success=success,
        first=asked[0],
        second=asked[1] if two else None,
        reference=side_of_trials(sheet, path),
        coverage=Coverage(compared=len(trials), left_out=dict(left_out)),
        judgement=judged[0],
        other=judged[1] if two else None,
        difference=paired(*right, seed=seed) if two else None,
        difference_of_all=strata.agreement(*right, seed=seed).excess if two and strata else None,
        settings=settings_apart(*sides) if two else (),
        notes=(
            *_notes(sheet, trials, sides, tables, judged[0]),
            *(f"{side.path}: {side.engines}" for side in asked if side.judged_again),
        ),
        seed=seed,
    )


def _missing(by_side: Sequence[Mapping[int, str]]) -> Counter[str]:
    """Trials that a run has no verdict on, by reason; those that both have none on count once."""
    left_out: Counter[str] = Counter()
    for k in sorted(set[int]().union(*by_side)):
        reasons = [missing.get(k) for missing in by_side]
        if len(reasons) == 1:
            reason_texts = [f"{reasons[0]} in the run"]
        elif reasons[0] == reasons[1]:
            reason_texts = [f"{reasons[0]} in either run"]
        else:
            named = zip(reasons, ("first", "second"), strict=True)
            reason_texts = [f"{reason} in the {which} run" for reason, which in named if reason]
        left_out[f"grasp {' and '.join(reason_texts)}"] += 1
    return left_out


def _informative(
    sheet: TrialSheet, tables: Sequence[Columns], indices: Sequence[int]
) -> tuple[list[int], Counter[str]]:
    """Trials that tell something of their grasp, and why the others do not."""
    left_out: Counter[str] = Counter()
    silent: dict[int, str] = {}
    for columns in tables:
        for verdict, rows in undecided(Factor.of(columns["outcome"])).items():
            silent |= dict.fromkeys(columns["trial"][rows].tolist(), f"simulated {verdict}")
    chosen = []
    for k in indices:
        outcome = sheet.trials[k].outcome
        if outcome is None:
            left_out["not carried out yet"] += 1
        elif not outcome.attempted:
            left_out[outcome.value] += 1
        elif k in silent:
            left_out[silent[k]] += 1
        else:
            chosen.append(k)
    return chosen, left_out


def _pairs(
    trials: Sequence[RealTrial], columns: Columns, chosen: Sequence[int], success: Success
) -> VerdictPairs:
    """Verdicts and outcomes of the chosen trials."""
    row = {k: r for r, k in enumerate(columns["trial"].tolist())}
    rows = np.array([row[k] for k in chosen], dtype=np.intp)
    outcomes = [t.outcome for t in trials if t.outcome is not None]
    ended = Factor.of(np.array([o.value for o in outcomes], dtype=np.str_))
    actual = np.array([succeeded(o, success) for o in outcomes], dtype=bool)
    table = ResultTable.of_columns(columns, NAMES).take(rows, NUMBERS)
    return make_pairs(table, ended, actual, success)


def _judgement(
    pairs: VerdictPairs,
    side: JudgedRuns,
    sheet: TrialSheet,
    trials: Sequence[RealTrial],
    offsets_mm: tuple[Array, Array],
    limit_mm: float,
    seed: int,
) -> Judgement:
    placement = placement_agreement(pairs, *offsets_mm, limit_mm=limit_mm, seed=seed)
    return judgement(
        pairs,
        scenes=side.scenes,
        strata=strata_of(sheet, trials),
        placement=placement,
        unpredictable=unpredictable_for(side),
        real=True,
        disagreements=disagreements(pairs, side.scenes, [side.folders], trials, offsets_mm[0]),
        seed=seed,
    )


def strata_of(sheet: TrialSheet, trials: Sequence[RealTrial]) -> Strata | None:
    """What the trials were chosen from; None if one of them was not chosen from anything."""
    keys = {key: k for k, key in enumerate(sheet.strata)}
    if not keys or any(trial.stratum not in keys for trial in trials):
        return None
    population: Array = np.array([s.population for s in sheet.strata.values()], dtype=float)
    return Strata(np.array([keys[t.stratum] for t in trials], dtype=np.intp), population)


def _notes(
    sheet: TrialSheet,
    trials: Sequence[RealTrial],
    sides: Sequence[JudgedRuns],
    tables: Sequence[Columns],
    judged: Judgement,
) -> tuple[str, ...]:
    """What people should know before they trust the figures."""
    notes = []
    hashes = {source.hash for source in sheet.runs.values()}
    for side, columns in zip(sides, tables, strict=True):
        own = set(columns["run"].tolist()) & hashes
        if not own:
            notes.append(
                f"the grasps were not chosen from {side.path}, but from another run of"
                " the same grasps"
            )
        changed = [
            sheet.trials[k].number
            for k, outcome in zip(columns["trial"].tolist(), columns["outcome"], strict=True)
            if own and sheet.trials[k].simulated != outcome
        ]
        if changed:
            notes.append(
                f"verdicts in {side.path} differ from those in the trials file for "
                f"{len(changed)} trials, such as trial {changed[0]}; those of the run are"
                " used"
            )
    if judged.not_represented:
        tried = {trial.stratum for trial in trials}
        without = [s for key, s in sheet.strata.items() if s.population and key not in tried]
        kinds = listing([f"{s.object} ({s.label})" for s in without])
        every = sum(s.population for s in sheet.strata.values())
        notes.append(
            f"figures for all grasps leave out {judged.not_represented} of the {every}"
            f" grasps from which the trials were chosen, as no trial of {kinds} was"
            " compared"
        )
    twice = len(trials) - len({(t.run, t.grasp) for t in trials})
    if twice:
        notes.append(f"{twice} trials repeat a grasp; intervals take them as independent")
    return tuple(notes)


def _no_outcome_message(path: Path, left_out: Counter[str]) -> str:
    reasons = ", ".join(f"{n} {reason}" for reason, n in left_out.most_common())
    return f"{path}: no trial can be compared yet ({reasons})"
