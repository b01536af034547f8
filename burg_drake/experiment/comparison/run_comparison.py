"""Compares runs with trials on the robot, or with each other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from burg_drake.core import Array, InvalidInputError, list_names, quote_value, suggest_names
from burg_drake.evaluation import Campaign, Columns, Run
from burg_drake.experiment.comparison.agreement_between_runs import (
    assess_run_agreement,
    both_executed,
)
from burg_drake.experiment.comparison.compared_runs import (
    ComparedRuns,
    add_rejudging_engines,
    approach_note,
    describe_trials,
    differing_settings,
    outcomes_unpredictable_for_runs,
    require_common_scene,
    require_same_phases,
)
from burg_drake.experiment.comparison.comparison import Comparison, Coverage
from burg_drake.experiment.comparison.confusion_matrix import Flags, compare_paired
from burg_drake.experiment.comparison.judge_assessment import (
    PLACEMENT_LIMIT_MM,
    Judgement,
    Strata,
    assess_judge,
    list_wrong_verdicts,
    placement_agreement,
    placement_errors_mm,
)
from burg_drake.experiment.comparison.margin_calibration import PROBABILITY_MARGIN
from burg_drake.experiment.comparison.result_table import Match, ResultTable, TextFactor, match_rows
from burg_drake.experiment.comparison.verdict_pairs import (
    MEASURED_MARGINS,
    PREDICTION_COLUMNS,
    PREDICTION_NUMBERS,
    REFERENCE_COLUMNS,
    VerdictPairs,
    find_result_rows,
    is_success_verdict,
    make_pairs,
    predicted_probability,
    rows_without_prediction,
)
from burg_drake.experiment.trials.trial_sheet import (
    RealTrial,
    Success,
    TrialSheet,
    is_success,
    load_trials,
)

SUCCESS_CRITERIA: tuple[Success, ...] = ("lifted", "held")
"""Criteria of success."""


def compare(
    first: Run | Campaign | str | Path,
    second: Run | Campaign | str | Path,
    trials: str | Path | None = None,
    *,
    success: Success | None = None,
    placement_limit_mm: float = PLACEMENT_LIMIT_MM,
    robustness: str | Path | None = None,
    seed: int = 0,
) -> Comparison:
    """Compares a run with trials on the robot or with another run, or two runs with trials.

    Example::

        found = burg.trials.compare("runs/first", "trials.yaml").judgement
        print(found.selected.precision.value, found.selected.precision.low)

    Args:
        first: run whose verdicts are taken as predictions, or its folder.
        second: a trials file, or a run of the same grasps, which then serves as reference.
        trials: a trials file; both runs are then compared with it, and with each other.
        success: criterion of success; if None the criterion in the trials file, or `lifted`.
        placement_limit_mm: maximum offset of every object in trials with good placement [mm].
        robustness: table of robustness, whose shares of success serve as predicted probability; if
            None, `robustness.csv` in the folder of the first run, if it exists.
        seed: seed of the intervals' resampling.

    Raises:
        InvalidInputError: there are no common grasps to compare.
        DocumentError: the trials file does not fit its schema.
    """
    if success is not None and success not in SUCCESS_CRITERIA:
        raise InvalidInputError(
            f"success is {quote_value(success)}; {suggest_names(str(success), SUCCESS_CRITERIA)}"
        )
    if not np.isfinite(placement_limit_mm) or placement_limit_mm < 0.0:
        raise InvalidInputError(f"the placement limit is {placement_limit_mm} mm; give 0 or more")
    if trials is None and not is_trials_file(second):
        return compare_runs(
            first, second, success=success or "lifted", robustness=robustness, seed=seed
        )
    trials_path = second if trials is None else trials
    return compare_trials(
        [first] if trials is None else [first, second],
        Path(str(trials_path)),
        success=success,
        placement_limit_mm=placement_limit_mm,
        robustness=robustness,
        seed=seed,
    )


def is_trials_file(path: Run | Campaign | str | Path) -> bool:
    """Whether a path is a trials file rather than a run, by its name."""
    return isinstance(path, (str, Path)) and Path(path).suffix in (".yaml", ".yml")


def compare_trials(
    given: Sequence[Run | Campaign | str | Path],
    path: Path,
    *,
    success: Success | None,
    placement_limit_mm: float,
    robustness: str | Path | None = None,
    seed: int = 0,
) -> Comparison:
    """Compares one or two runs with the trials in a file; see `compare`."""
    sheet = load_trials(path)
    success = success or sheet.selection.success
    sides = [ComparedRuns.load(run) for run in given]
    found_rows = [find_result_rows(sheet, path, runs) for runs in sides]
    tables = [columns for columns, _ in found_rows]
    left_out = _count_missing([missing for _, missing in found_rows])
    indices = set.intersection(*(set(t["trial"].tolist()) for t in tables))
    chosen, uninformative = _select_informative(sheet, tables, sorted(indices))
    left_out.update(uninformative)
    if not chosen:
        reasons = ", ".join(f"{n} {reason}" for reason, n in left_out.most_common())
        raise InvalidInputError(f"{path}: no trial can be compared yet ({reasons})")
    trials = [sheet.trials[k] for k in chosen]
    pairs_by_side = []
    for runs, columns in zip(sides, tables, strict=True):
        pairs = _pair_trials(trials, columns, chosen, success)
        probability = predicted_probability(runs, pairs, robustness if runs is sides[0] else None)
        pairs_by_side.append(
            pairs if probability is None else pairs.with_margin(PROBABILITY_MARGIN, probability)
        )
    scenes = [sheet.runs[trial.run].scene.content for trial in trials]
    instances = sides[0].instances_of(set(scenes))
    offsets_mm = placement_errors_mm(
        trials, [instances[scene] for scene in scenes], placement_limit_mm
    )
    judgements = [
        _assess_run(pairs, runs, sheet, trials, offsets_mm, placement_limit_mm, seed)
        for pairs, runs in zip(pairs_by_side, sides, strict=True)
    ]
    two = len(sides) == 2
    described = [
        add_rejudging_engines(runs.described(), pairs.judged_again)
        for pairs, runs in zip(pairs_by_side, sides, strict=True)
    ]
    right = [pairs.predicted == pairs.actual for pairs in pairs_by_side]
    strata = selection_strata(sheet, trials)
    return Comparison(
        kind="simulators" if two else "trials",
        success=success,
        first=described[0],
        second=described[1] if two else None,
        reference=describe_trials(sheet, path),
        coverage=Coverage(compared=len(trials), left_out=dict(left_out)),
        judgement=judgements[0],
        other=judgements[1] if two else None,
        difference=compare_paired(*right, seed=seed) if two else None,
        difference_of_all=strata.agreement(*right, seed=seed).excess if two and strata else None,
        settings=differing_settings(*sides) if two else (),
        notes=(
            *_comparison_notes(sheet, trials, sides, tables, judgements[0]),
            *(f"{side.path}: {side.engines}" for side in described if side.judged_again),
        ),
        seed=seed,
    )


def _count_missing(by_side: Sequence[Mapping[int, str]]) -> Counter[str]:
    """Counts of trials without a verdict of a run, by reason. A trial that lacks the verdicts of
    both runs counts once.
    """
    left_out: Counter[str] = Counter()
    for k in sorted(set[int]().union(*by_side)):
        reasons = [missing.get(k) for missing in by_side]
        named = zip(reasons, ("first", "second"), strict=False)
        text = " and ".join(f"{reason} in the {which} run" for reason, which in named if reason)
        if len(set(reasons)) == 1:
            text = f"{reasons[0]} in {'the' if len(reasons) == 1 else 'either'} run"
        left_out[f"grasp {text}"] += 1
    return left_out


def _select_informative(
    sheet: TrialSheet, tables: Sequence[Columns], indices: Sequence[int]
) -> tuple[list[int], Counter[str]]:
    """Selects informative trials; also returns counts of the other trials by reason."""
    left_out: Counter[str] = Counter()
    without_prediction: dict[int, str] = {}
    for columns in tables:
        for verdict, rows in rows_without_prediction(TextFactor.of(columns["outcome"])).items():
            indices_of_rows = columns["trial"][rows].tolist()
            without_prediction |= dict.fromkeys(indices_of_rows, f"simulated {verdict}")
    chosen = []
    for k in indices:
        outcome = sheet.trials[k].outcome
        if outcome is None:
            left_out["not carried out yet"] += 1
        elif not outcome.attempted:
            left_out[outcome.value] += 1
        elif k in without_prediction:
            left_out[without_prediction[k]] += 1
        else:
            chosen.append(k)
    return chosen, left_out


def _pair_trials(
    trials: Sequence[RealTrial], columns: Columns, chosen: Sequence[int], success: Success
) -> VerdictPairs:
    """Verdicts and outcomes of the chosen trials."""
    row = {k: r for r, k in enumerate(columns["trial"].tolist())}
    rows = np.array([row[k] for k in chosen], dtype=np.intp)
    outcomes = [t.outcome for t in trials if t.outcome is not None]
    ended = TextFactor.of(np.array([o.value for o in outcomes], dtype=np.str_))
    actual = np.array([is_success(o, success) for o in outcomes], dtype=bool)
    table = ResultTable.of_columns(columns, PREDICTION_COLUMNS).take(rows, PREDICTION_NUMBERS)
    return make_pairs(table, ended, actual, success)


def _assess_run(
    pairs: VerdictPairs,
    runs: ComparedRuns,
    sheet: TrialSheet,
    trials: Sequence[RealTrial],
    offsets_mm: tuple[Array, Array],
    limit_mm: float,
    seed: int,
) -> Judgement:
    placement = placement_agreement(pairs, *offsets_mm, limit_mm=limit_mm, seed=seed)
    return assess_judge(
        pairs,
        scenes=runs.scenes,
        strata=selection_strata(sheet, trials),
        placement=placement,
        unpredictable=outcomes_unpredictable_for_runs(runs),
        real=True,
        disagreements=list_wrong_verdicts(
            pairs, runs.scenes, [runs.folders], trials, offsets_mm[0]
        ),
        seed=seed,
    )


def selection_strata(sheet: TrialSheet, trials: Sequence[RealTrial]) -> Strata | None:
    """Strata of the trials; None if a trial has no stratum."""
    keys = {key: k for k, key in enumerate(sheet.strata)}
    if not keys or any(trial.stratum not in keys for trial in trials):
        return None
    population: Array = np.array([s.population for s in sheet.strata.values()], dtype=float)
    return Strata(np.array([keys[t.stratum] for t in trials], dtype=np.intp), population)


def _comparison_notes(
    sheet: TrialSheet,
    trials: Sequence[RealTrial],
    sides: Sequence[ComparedRuns],
    tables: Sequence[Columns],
    judgement: Judgement,
) -> tuple[str, ...]:
    """Caveats about the figures."""
    notes = []
    hashes = {source.hash for source in sheet.runs.values()}
    for runs, columns in zip(sides, tables, strict=True):
        is_source = not hashes.isdisjoint(columns["run"].tolist())
        if not is_source:
            notes.append(
                f"the grasps were not chosen from {runs.path}, but from another run of"
                " the same grasps"
            )
        changed = [
            sheet.trials[k].number
            for k, outcome in zip(columns["trial"].tolist(), columns["outcome"], strict=True)
            if is_source and sheet.trials[k].simulated != outcome
        ]
        if changed:
            notes.append(
                f"verdicts in {runs.path} differ from those in the trials file for "
                f"{len(changed)} trials, such as trial {changed[0]}; those of the run are"
                " used"
            )
    if judgement.not_represented:
        tried = {trial.stratum for trial in trials}
        without = [s for key, s in sheet.strata.items() if s.population and key not in tried]
        kinds = list_names([f"{s.object} ({s.label})" for s in without])
        population = sum(s.population for s in sheet.strata.values())
        notes.append(
            f"figures for all grasps leave out {judgement.not_represented} of the {population}"
            f" grasps from which the trials were chosen, as no trial of {kinds} was"
            " compared"
        )
    repeated = len(trials) - len({(t.run, t.grasp) for t in trials})
    if repeated:
        notes.append(f"{repeated} trials repeat a grasp; intervals take them as independent")
    return tuple(notes)


def compare_runs(
    first: Run | Campaign | str | Path,
    second: Run | Campaign | str | Path,
    *,
    success: Success = "lifted",
    robustness: str | Path | None = None,
    seed: int = 0,
) -> Comparison:
    """Compares the verdicts of two runs; see `compare`.

    If the runs have different modes, only grasps that both executed count: other verdicts answer
    different questions.
    """
    sides = ComparedRuns.load(first), ComparedRuns.load(second)
    require_common_scene(*sides)
    require_same_phases(*sides)
    with ThreadPoolExecutor() as pool:  # reading and unpacking release the GIL
        one, other = pool.map(ComparedRuns.table, sides, (PREDICTION_COLUMNS, REFERENCE_COLUMNS))
    match = match_rows(one, other)
    if not len(match.first):
        raise InvalidInputError(_no_common_grasps_message(sides, match))
    modes = [runs.opened.document.mode for runs in sides]
    pairs, second_rows, left_out = pair_runs((one, other), match, success, modes[0] == modes[1])
    if not len(pairs) and modes[0] != modes[1]:
        raise InvalidInputError(
            f"{sides[0].path} and {sides[1].path} were made in different modes ({modes[0]}"
            f" and {modes[1]}), and no grasp was executed in both, so there is nothing to"
            " compare; evaluate one of them again in the mode of the other"
        )
    probability = predicted_probability(sides[0], pairs, robustness)
    if probability is not None:
        pairs = pairs.with_margin(PROBABILITY_MARGIN, probability)
    scenes = sides[0].scenes
    folders = [runs.folders for runs in sides]
    wrong = list_wrong_verdicts(pairs, scenes, folders)
    settings, note = differing_settings(*sides), approach_note(*sides)
    notes = () if settings else ("the runs have the same settings",)
    return Comparison(
        kind="runs",
        success=success,
        first=add_rejudging_engines(sides[0].described(), pairs.judged_again),
        reference=add_rejudging_engines(sides[1].described(), second_rows.texts["judged_again"]),
        coverage=Coverage(
            compared=len(pairs),
            only_first=match.only_first,
            only_second=match.only_second,
            other_content=match.other_content,
            left_out=left_out,
        ),
        judgement=assess_judge(pairs, scenes=scenes, disagreements=wrong, seed=seed),
        agreement=assess_run_agreement(pairs, second_rows, scenes, folders, seed=seed),
        settings=settings,
        notes=(*notes, note) if note else notes,
        seed=seed,
    )


def pair_runs(
    tables: tuple[ResultTable, ResultTable],
    match: Match,
    success: Success,
    same_mode: bool = True,
) -> tuple[VerdictPairs, ResultTable, dict[str, int]]:
    """Pairs the verdicts of two runs. In different modes, grasps that only one run executed, or
    neither, are omitted.

    Returns:
        Pairs of verdicts on the common grasps, rows of the second run for these grasps, and counts
        of omitted grasps by reason.
    """
    numbers = (*MEASURED_MARGINS, "confidence")
    second = tables[1].take(match.second, numbers)
    ended = second.texts["outcome"]
    pairs = make_pairs(
        tables[0].take(match.first, PREDICTION_NUMBERS),
        ended,
        is_success_verdict(ended, success),
        success,
    )
    reasons: dict[str, Flags] = {}
    for where, verdicts in (("first", pairs.simulated), ("second", pairs.ended)):
        reasons |= {
            f"{k} in the {where}": rows for k, rows in rows_without_prediction(verdicts).items()
        }
    if not same_mode:
        reason = "not executed in both runs, which have different modes"
        reasons[reason] = ~both_executed(pairs.stage, second.texts["stage"])
    keep = np.ones(len(pairs), dtype=bool)
    left_out = {}
    for reason, rows in reasons.items():
        if rows.any():
            left_out[reason] = int((rows & keep).sum())
            keep &= ~rows
    if keep.all():
        return pairs, second, left_out
    return pairs.take(keep), second.take(np.flatnonzero(keep), numbers), left_out


def _no_common_grasps_message(sides: tuple[ComparedRuns, ComparedRuns], match: Match) -> str:
    paths, place = f"{sides[0].path} and {sides[1].path}", sides[0].grasp_folders_text
    if match.other_content:
        return (
            f"{paths} have {match.other_content} grasps with the same ids, but none with the same"
            f" pose and width; evaluate the second run with the grasps of the first ({place})"
        )
    return (
        f"{paths} have no grasp in common ({match.only_first} and {match.only_second} are judged);"
        f" evaluate the second run with the grasps of the first ({place})"
    )
