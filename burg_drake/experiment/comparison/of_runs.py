"""A run against another one of the same grasps, whose verdicts count as what happened."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from burg_drake.core import InvalidInputError
from burg_drake.evaluation.store import Campaign, Run
from burg_drake.experiment.comparison.comparison import Comparison, Coverage
from burg_drake.experiment.comparison.disagreement import disagreements
from burg_drake.experiment.comparison.judge_assessment import judgement
from burg_drake.experiment.comparison.run_agreement import (
    SecondVerdicts,
    both_executed,
    run_agreement,
)
from burg_drake.experiment.pairing import (
    MEASURED,
    NAMES,
    NUMBERS,
    REFERENCE_NAMES,
    JudgedRuns,
    Match,
    ResultTable,
    VerdictPairs,
    approach_note,
    make_pairs,
    match_rows,
    predicted_probability,
    require_common_scene,
    require_same_phases,
    settings_apart,
    settled_side,
    successes,
    undecided,
)
from burg_drake.experiment.statistics import PROBABILITY, Flags
from burg_drake.experiment.trials import Success

NOT_EXECUTED = "not executed in both runs, which have different modes"
"""Why grasps are left out of runs that asked different questions before the grip."""


def compare_runs(
    first: Run | Campaign | str | Path,
    second: Run | Campaign | str | Path,
    *,
    success: Success = "lifted",
    robustness: str | Path | None = None,
    seed: int = 0,
) -> Comparison:
    """Compares the verdicts of two runs; see `compare`.

    Of runs in different modes only grasps count that both executed: what else they say answers
    different questions.
    """
    sides = JudgedRuns.load(first), JudgedRuns.load(second)
    require_common_scene(*sides)
    require_same_phases(*sides)
    with ThreadPoolExecutor() as pool:  # reading and unpacking leave Python alone
        one, other = pool.map(JudgedRuns.table, sides, (NAMES, REFERENCE_NAMES))
    tables = one, other
    found = match_rows(*tables)
    if not len(found.first):
        raise InvalidInputError(_nothing_in_common(sides, found))
    modes = [side.found.document.mode for side in sides]
    pairs, others, left_out = pairs_of_runs(tables, found, success, modes[0] == modes[1])
    if not len(pairs) and modes[0] != modes[1]:
        raise InvalidInputError(_nothing_executed(sides, modes))
    probability = predicted_probability(sides[0], pairs, robustness)
    if probability is not None:
        pairs = pairs.with_margin(PROBABILITY, probability)
    scenes = sides[0].scenes
    folders = [side.folders for side in sides]
    wrong = disagreements(pairs, scenes, folders)
    apart, note = settings_apart(*sides), approach_note(*sides)
    notes = () if apart else ("the runs have the same settings",)
    return Comparison(
        kind="runs",
        success=success,
        first=settled_side(sides[0].side, pairs.judged_again),
        reference=settled_side(sides[1].side, others.judged_again),
        coverage=Coverage(
            compared=len(pairs),
            only_first=found.only_first,
            only_second=found.only_second,
            other_content=found.other_content,
            left_out=left_out,
        ),
        judgement=judgement(pairs, scenes=scenes, disagreements=wrong, seed=seed),
        agreement=run_agreement(pairs, others, scenes, folders, seed=seed),
        settings=apart,
        notes=(*notes, note) if note else notes,
        seed=seed,
    )


def pairs_of_runs(
    tables: tuple[ResultTable, ResultTable],
    found: Match,
    success: Success,
    same_mode: bool = True,
) -> tuple[VerdictPairs, SecondVerdicts, dict[str, int]]:
    """Pairs of verdicts of the grasps in common, what else the second run found of them, and what
    is left out by reason: of different modes all that not both executed."""
    others = tables[1].take(found.second, (*MEASURED, "confidence"))
    ended, stage = others.texts["outcome"], others.texts["stage"]
    pairs = make_pairs(
        tables[0].take(found.first, NUMBERS), ended, successes(ended, success), success
    )
    margins = {name: others.numbers[name] for name in MEASURED}
    again, confidence = others.texts["judged_again"], others.numbers["confidence"]
    second = SecondVerdicts(stage, again, confidence, margins)
    reasons: dict[str, Flags] = {}
    for where, verdicts in (("first", pairs.simulated), ("second", pairs.ended)):
        reasons |= {f"{k} in the {where}": rows for k, rows in undecided(verdicts).items()}
    if not same_mode:
        reasons[NOT_EXECUTED] = ~both_executed(pairs.stage, stage)
    keep = np.ones(len(pairs), dtype=bool)
    left_out = {}
    for reason, rows in reasons.items():
        if rows.any():
            left_out[reason] = int((rows & keep).sum())
            keep &= ~rows
    if keep.all():
        return pairs, second, left_out
    return pairs.take(keep), second.take(keep), left_out


def _nothing_executed(sides: tuple[JudgedRuns, JudgedRuns], modes: Sequence[str]) -> str:
    return (
        f"{sides[0].path} and {sides[1].path} were made in different modes ({modes[0]}"
        f" and {modes[1]}), and no grasp was executed in both, so there is nothing to"
        " compare; evaluate one of them again in the mode of the other"
    )


def _nothing_in_common(sides: tuple[JudgedRuns, JudgedRuns], found: Match) -> str:
    paths, place = f"{sides[0].path} and {sides[1].path}", sides[0].grasps_place
    if found.other_content:
        return (
            f"{paths} have {found.other_content} grasps with the same ids, but none with the same"
            f" pose and width; evaluate the second run with the grasps of the first ({place})"
        )
    return (
        f"{paths} have no grasp in common ({found.only_first} and {found.only_second} are judged);"
        f" evaluate the second run with the grasps of the first ({place})"
    )
