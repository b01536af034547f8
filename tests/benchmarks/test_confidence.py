"""The study of confidence: its fit finds what is there, and its figures are what they say."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
from confidence import population_of, rounded
from confidence_fit import Judged, fit, fit_all, summarize_bin
from confidence_plot import reliability_diagram
from confidence_trials import OBJECTS, Grasp, changed, friction_limit
from oracle.cases import Case
from oracle.strangers import KINDS
from scipy.spatial.transform import Rotation

from burg_drake.core import Outcome
from burg_drake.objects import load_library
from burg_drake.simulation import Population

SIGNS = {
    "carried": -1.0,
    "turned": -1.0,
    "limit": 0.4,
    "slip": -5.0,
    "tilt": -3.0,
    "patch_area": 0.015,
    "lift": 0.3,
}
POPULATION = Population(
    objects=1, max_mass=1.0, min_thickness=0.01, min_length=0.02, max_length=0.3
)


def made_up(count: int, seed: int) -> tuple[list[Judged], np.ndarray]:
    """Verdicts that are confirmed with a known probability, which falls with the slip alone."""
    rng = np.random.default_rng(seed)
    slip, other = rng.uniform(-6.0, -2.0, count), rng.uniform(0.0, 1.0, count)
    p = 1.0 / (1.0 + np.exp(2.0 * (slip + 3.0)))
    found = [
        Judged(
            engine="standard",
            object="box",
            held_out=False,
            kind="ordinary",
            outcome=Outcome.LIFTED,
            signs={"slip": float(s), "tilt": float(o)},
            confirmed=float(rng.random() < q),
        )
        for s, o, q in zip(slip, other, p, strict=True)
    ]
    return found, p


def test_the_fit_finds_the_probability_that_is_there() -> None:
    verdicts, p = made_up(8000, seed=1)
    curves = fit(verdicts)
    logits = [sum(c.at(v.signs[name]) for name, c in curves.items()) for v in verdicts]
    said = 1.0 / (1.0 + np.exp(-np.array(logits)))
    assert np.abs(said - p).mean() < 0.02
    assert np.ptp(curves["slip"].logits) > 10 * np.ptp(curves["tilt"].logits)


def test_nothing_is_fitted_on_what_is_held_out() -> None:
    verdicts, _ = made_up(200, seed=3)
    lost = [dataclasses.replace(v, outcome=Outcome.SLIPPED) for v in verdicts]
    others = [
        dataclasses.replace(v, held_out=True, confirmed=1.0 - v.confirmed)
        for v in (*verdicts, *lost)
    ]
    alone = fit_all({"standard": [*verdicts, *lost]}, POPULATION)
    assert fit_all({"standard": [*verdicts, *lost, *others]}, POPULATION) == alone
    assert json.loads(alone)["population"]["max_length"] == 0.3


def test_every_second_object_of_each_kind_is_held_out() -> None:
    def is_held_out(name: str) -> bool:
        case = Case(f"{name}/0/a", name, 0, ((0.0,) * 4,) * 3, friction=0.4, mass=0.3)
        return Grasp(case, "hard").held_out

    for rows in KINDS.values():
        assert [is_held_out(name) for name, _, _ in rows] == [False, True] * 3
    fitted = [name for name in OBJECTS if not is_held_out(name)]
    assert len(fitted) == 48 and len(OBJECTS) == 78


def test_a_box_that_hangs_below_the_pads_is_carried_by_its_weight_over_the_force() -> None:
    """Pads of 2 x 40 N; the box is gripped above its centre, and beside it, where it turns."""
    X_OG = np.diag([1.0, -1.0, -1.0, 1.0])
    case = Case("box/0/a", "box", 0, tuple(map(tuple, X_OG[:3])), friction=0.4, mass=1.0)
    limit = friction_limit(case)
    assert limit is not None and 9.81 / 80.0 < limit < 1.3 * 9.81 / 80.0
    beside = X_OG.copy()
    beside[1, 3] = 0.03
    turning = dataclasses.replace(case, X_OG=tuple(map(tuple, beside[:3])))
    assert friction_limit(turning) is None


def test_the_oracle_gets_a_trial_that_is_changed_by_as_much_as_said() -> None:
    X_OG = np.diag([1.0, -1.0, -1.0, 1.0])
    cases = [
        Case(f"can/0/{k}", "can", 0, tuple(map(tuple, X_OG[:3])), friction=0.4, mass=0.3)
        for k in range(2000)
    ]
    found = [changed(case, 1) for case in cases]
    assert found == [changed(case, 1) for case in cases]
    X_GG = np.linalg.inv(X_OG) @ np.array([case.matrix for case in found])
    logarithms = np.log([case.friction / 0.4 for case in found])
    turns = [np.rad2deg(Rotation.from_matrix(X[:3, :3]).as_rotvec()) for X in X_GG]
    for values, deviation in ((logarithms, 0.05), (X_GG[:, :3, 3], 5e-4), (turns, 0.5)):
        assert np.std(values, axis=0) == pytest.approx(deviation, rel=0.1)
        assert np.mean(values, axis=0) == pytest.approx(0.0, abs=0.1 * deviation)
    assert {case.mass for case in found} == {0.3}


def test_a_bin_by_hand() -> None:
    (one, *_), _ = made_up(1, seed=0)
    verdicts = [
        dataclasses.replace(one, signs=SIGNS, confirmed=confirmed)
        for confirmed in (1.0, 1.0, 1.0, 0.0)
    ]
    found = summarize_bin(verdicts)
    assert found.confirmed == 0.75 and found.count == 4
    assert found.low == pytest.approx(0.3006, abs=1e-4)  # Wilson's, by hand
    assert found.high == pytest.approx(0.9544, abs=1e-4)
    assert found.error == pytest.approx(abs(verdicts[0].confidence - 0.75))


def test_the_population_is_rounded_outwards() -> None:
    library = load_library("household")
    cases = [
        Case(f"{name}/0/a", name, 0, ((0.0,) * 4,) * 3, friction=0.4, mass=mass)
        for name, mass in (("marble", 0.2), ("screwdriver", 1.234))
    ]
    found = population_of([Grasp(case, "hard") for case in cases], library)
    assert found.objects == 2 and found.max_mass == 1.3
    assert found.min_thickness == 0.028 and found.min_length == 0.03  # 28.6 and 30 mm
    assert found.max_length == 0.22  # 210.1 mm
    assert rounded(0.25, math.ceil) == rounded(0.25, math.floor) == 0.25


def test_the_diagram_says_how_often_what_was_said_came_true() -> None:
    verdicts, _ = made_up(200, seed=2)
    held_out = [dataclasses.replace(v, held_out=True, signs=SIGNS) for v in verdicts]
    text = reliability_diagram({"standard": held_out})
    # all of them have the same confidence, and so are in one bin
    confirmed = sum(v.confirmed for v in verdicts) / 200
    assert text.count("<circle") == 1 and f"confirmed {confirmed:.3f} of 200" in text
    assert "<circle" not in reliability_diagram({"standard": verdicts})
