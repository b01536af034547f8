"""Which grasps are looked at first: by score, evenly without, and as runs rank them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from burg_drake.core import GraspSet, UnknownNameError
from burg_drake.evaluation import (
    Run,
    best_of_each,
    grasp_index,
    rank_by_score,
    rank_run_grasps,
    run_grasps,
    shown_ids,
)

HOLDER = np.array(["mug", "box", "mug", "mug", "box", "mug"])
ALL = np.ones(6, dtype=bool)


def grasps(score: list[float] | None) -> GraspSet:
    X_OG = np.tile(np.eye(4), (6, 1, 1))
    X_OG[:, 2, 3] = np.arange(6)
    return GraspSet.create(X_OG, object=HOLDER, score=score)


def test_by_score_with_unknown_ones_last() -> None:
    ranking = rank_by_score(grasps([1.0, np.nan, 3.0, np.nan, 5.0, 2.0]))
    assert ranking.by == "score"
    assert best_of_each(HOLDER, ALL, ranking, None) == [2, 5, 0, 3, 4, 1]
    assert best_of_each(HOLDER, ALL, ranking, 1) == [2, 4]
    assert best_of_each(HOLDER, np.arange(6) != 2, ranking, 1) == [5, 4]


def test_of_a_run_held_ones_come_before_lost_ones(own_run: Run) -> None:
    run = own_run
    (first,) = [run.candidates.id.index(id) for id in run.best()]
    others = [k for k in range(len(run.candidates.id)) if run.results["outcome"][k] != "lifted"]
    outcomes = run.results["outcome"].astype(object)
    outcomes[others] = np.resize(["no_ik", "slipped", "", "lifted_turned"], len(others))
    ranking = rank_run_grasps(run, run_grasps(run).with_columns(outcome=outcomes.astype(str)))
    assert ranking.order[0] == first
    texts = [text for text in outcomes[ranking.order] if text != "lifted"]
    assert list(dict.fromkeys(texts)) == ["lifted_turned", "slipped", "no_ik", ""]


def test_what_the_score_is_made_of() -> None:
    scored = replace(grasps([1.0] * 6), provenance={"quality": {"by": "load_margin"}})
    assert rank_by_score(scored).by == "score (load_margin)"


def test_evenly_without_scores() -> None:
    ranking = rank_by_score(grasps(None))
    assert ranking.by == ""
    assert best_of_each(HOLDER, ALL, ranking, 2) == [0, 3, 1, 4]


def test_identifiers_with_and_without_instances() -> None:
    plain = grasps(None)
    twice = GraspSet.concatenate(
        plain.select([0, 2]).with_columns(instance=name) for name in ("mug_1", "mug_2")
    )
    id = str(plain.id[2])
    assert grasp_index(plain, id, "file") == 2
    assert grasp_index(twice, f"mug_2-{id}", "file") == shown_ids(twice).index(f"mug_2-{id}") == 3
    with pytest.raises(UnknownNameError, match=f"file has no grasp '{id}'.*mug_[12]-{id}"):
        grasp_index(twice, id, "file")
