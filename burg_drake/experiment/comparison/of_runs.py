"""A run against another one of the same grasps, whose verdicts are taken for the truth."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from burg_drake.core import InvalidInputError
from burg_drake.evaluation.store import Campaign, Run
from burg_drake.experiment.comparison.comparison import Comparison, Coverage
from burg_drake.experiment.comparison.disagreement import disagreements
from burg_drake.experiment.comparison.judge_assessment import judgement
from burg_drake.experiment.pairing import (
    NAMES,
    REFERENCE_NAMES,
    JudgedRuns,
    Match,
    ResultTable,
    VerdictPairs,
    make_pairs,
    match_rows,
    predicted_probability,
    require_common_scene,
    settings_apart,
    successes,
    undecided,
)
from burg_drake.experiment.statistics import PREDICTORS, PROBABILITY
from burg_drake.experiment.trials import Success


def compare_runs(
    first: Run | Campaign | str | Path,
    second: Run | Campaign | str | Path,
    *,
    success: Success = "lifted",
    robustness: str | Path | None = None,
    seed: int = 0,
) -> Comparison:
    """Compares the verdicts of two runs; see `compare`."""
    sides = JudgedRuns.load(first), JudgedRuns.load(second)
    require_common_scene(*sides)
    with ThreadPoolExecutor() as pool:  # reading and unpacking leave Python alone
        one, other = pool.map(JudgedRuns.table, sides, (NAMES, REFERENCE_NAMES))
    tables = one, other
    found = match_rows(*tables)
    if not len(found.first):
        raise InvalidInputError(_nothing_in_common(sides, found))
    pairs, left_out = pairs_of_runs(tables, found, success)
    probability = predicted_probability(sides[0], pairs, robustness)
    if probability is not None:
        pairs = pairs.with_margin(PROBABILITY, probability)
    scenes = sides[0].scenes
    wrong = disagreements(pairs, scenes, [side.folders for side in sides])
    apart = settings_apart(*sides)
    return Comparison(
        kind="runs",
        success=success,
        first=sides[0].side,
        reference=sides[1].side,
        coverage=Coverage(
            compared=len(pairs),
            only_first=found.only_first,
            only_second=found.only_second,
            other_content=found.other_content,
            left_out=left_out,
        ),
        judgement=judgement(pairs, scenes=scenes, disagreements=wrong, seed=seed),
        settings=apart,
        notes=() if apart else ("the runs have the same settings",),
        seed=seed,
    )


def pairs_of_runs(
    tables: tuple[ResultTable, ResultTable], found: Match, success: Success
) -> tuple[VerdictPairs, dict[str, int]]:
    """Pairs of verdicts of the grasps in common, and what is left out by reason."""
    ended = tables[1].texts["outcome"].take(found.second)
    pairs = make_pairs(
        tables[0].take(found.first, PREDICTORS), ended, successes(ended, success), success
    )
    keep = np.ones(len(pairs), dtype=bool)
    left_out = {}
    for where, verdicts in (("first", pairs.simulated), ("second", pairs.ended)):
        for outcome, rows in undecided(verdicts).items():
            if rows.any():
                left_out[f"{outcome} in the {where}"] = int((rows & keep).sum())
                keep &= ~rows
    return pairs if keep.all() else pairs.take(keep), left_out


def _nothing_in_common(sides: tuple[JudgedRuns, JudgedRuns], found: Match) -> str:
    paths = f"{sides[0].path} and {sides[1].path}"
    if found.other_content:
        return (
            f"{paths} have {found.other_content} grasps with the same ids, but none with the same"
            " pose and width; evaluate the second run with the grasps of the first,"
            f" {sides[0].path / 'grasps.npz'}"
        )
    return (
        f"{paths} have no grasp in common ({found.only_first} and {found.only_second} are judged);"
        f" evaluate the second run with the grasps of the first, {sides[0].path / 'grasps.npz'}"
    )
