"""Texts as numbers, and the best grasps of many, against plain Python."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.core import InvalidInputError, Outcome
from burg_drake.evaluation import RANKING_CLEARANCE_STEP, best_rows, code_texts, member_codes


def test_codes_are_places_among_the_members() -> None:
    members = tuple(Outcome)
    places = np.random.default_rng(0).integers(len(members), size=500)
    values = np.array([members[k].value for k in places])
    assert member_codes(code_texts(values), members).tolist() == places.tolist()
    assert len(member_codes(code_texts(values[:0]), members)) == 0


def test_what_is_no_member_is_named() -> None:
    with pytest.raises(InvalidInputError, match="lifted_up"):
        member_codes(code_texts(np.array(["lifted", "lifted_up"])), ("lifted", "slipped"))


@pytest.mark.parametrize("count", [1, 3, 40, 1000])
def test_the_first_of_the_best_are_those_of_the_whole_ranking(count: int) -> None:
    """Whatever the ties: what cannot be among the first need not be ranked."""
    rng = np.random.default_rng(count)
    n = 300
    columns = {
        "id": rng.permutation(np.array([f"g{k:03d}" for k in range(n)])),
        "instance": rng.choice(["a", "b", "c"], n),
        "outcome": rng.choice(["lifted", "slipped"], n),
        "clearance": RANKING_CLEARANCE_STEP * rng.choice([np.nan, *range(6)], n),
        "slip": 0.001 * rng.integers(3, size=n),
        "tilt": np.zeros(n),
        "others_moved": np.zeros(n),
        "patch_area": 1e-5 * rng.integers(2, size=n),
        "score": rng.random(n),
    }
    columns["object"] = columns["instance"]

    def rank(row: int) -> tuple:
        room = columns["clearance"][row]
        margins = columns["slip"][row], -columns["patch_area"][row], -columns["score"][row]
        return (np.isnan(room), -room if room == room else 0.0, *margins, columns["id"][row])

    lifted = [row for row in range(n) if columns["outcome"][row] == "lifted"]
    ranked = sorted(lifted, key=rank)
    assert best_rows(columns, count) == ranked[:count]
    names = dict.fromkeys(columns["object"].tolist())
    own = [[row for row in ranked if columns["object"][row] == name][:count] for name in names]
    assert best_rows(columns, count, each=True) == [row for rows in own for row in rows]
