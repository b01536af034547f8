"""The study of confidence: its fit finds what is there, and its figures are what they say."""

from __future__ import annotations

import math

import numpy as np
import pytest
from confidence_fit import Judged, calibration_error, fit
from confidence_plot import reliability_diagram
from confidence_trials import WORLDS, is_held_out, perturbed
from oracle.cases import Case

from burg_drake.core import Outcome


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
            worlds=tuple((rng.random(4) < q).astype(float)),
            oracle=float(rng.random() < q),
        )
        for s, o, q in zip(slip, other, p, strict=True)
    ]
    return found, p


def test_the_fit_finds_the_probability_that_is_there() -> None:
    verdicts, p = made_up(4000, seed=1)
    curves = fit(verdicts)
    logits = [sum(c.at(v.signs[name]) for name, c in curves.items()) for v in verdicts]
    said = 1.0 / (1.0 + np.exp(-np.array(logits)))
    assert np.abs(said - p).mean() < 0.02
    assert np.ptp(curves["slip"].logits) > 10 * np.ptp(curves["tilt"].logits)


def test_the_calibration_error_by_hand() -> None:
    p = np.repeat([0.2, 0.6, 0.9, 1.0], 50)
    exact = np.concatenate([np.repeat([1.0, 0.0], [round(50 * q), 50 - round(50 * q)])
                            for q in (0.2, 0.6, 0.9, 1.0)])  # fmt: skip
    assert calibration_error(p, exact, bins=4) == pytest.approx(0.0)
    assert calibration_error(p, np.ones(200), bins=4) == pytest.approx((0.8 + 0.4 + 0.1) / 4)


def test_the_oracle_counts_as_much_as_all_worlds() -> None:
    (one, *_), _ = made_up(1, seed=0)
    changed = Judged(**{**vars(one), "worlds": (1.0, 1.0, 0.0, 1.0), "oracle": 0.0})
    assert changed.confirmed == pytest.approx(0.375)
    assert Judged(**{**vars(changed), "oracle": None}).confirmed == pytest.approx(0.75)
    assert math.isnan(Judged(**{**vars(changed), "worlds": (), "oracle": None}).confirmed)


def test_worlds_differ_by_what_they_say() -> None:
    X_OG = tuple(tuple(row) for row in np.eye(4)[:3].tolist())
    case = Case("can/0/a", "can", 0, X_OG, friction=0.4, mass=0.3)
    pose, friction = perturbed(case, 0)
    assert (pose == np.eye(4)).all() and friction == 0.4
    moved = [perturbed(case, world) for world in range(1, len(WORLDS))]
    again = [perturbed(case, world) for world in range(1, len(WORLDS))]
    for (pose, friction), (same, _) in zip(moved, again, strict=True):
        assert (pose == same).all() and not np.array_equal(pose, np.eye(4))
        assert np.linalg.norm(pose[:3, 3]) < 0.003
        assert 0.3 < friction < 0.5 and friction != 0.4


def test_each_object_is_fitted_on_or_held_out() -> None:
    assert not is_held_out("box") and is_held_out("bottle")
    assert is_held_out("003_cracker_box")
    assert not is_held_out("household_bowl") and is_held_out("household_mug")


def test_the_diagram_says_how_often_what_was_said_came_true() -> None:
    verdicts, _ = made_up(200, seed=2)
    held_out = [Judged(**{**vars(v), "held_out": True, "signs": SIGNS}) for v in verdicts]
    text = reliability_diagram({"standard": held_out})
    # all of them have the same confidence, and so are in one bin of either panel
    confirmed = sum(v.oracle or 0.0 for v in verdicts) / 200
    assert text.count("<circle") == 2 and f"confirmed {confirmed:.3f} of 200" in text
    assert "<circle" not in reliability_diagram({"standard": verdicts})


SIGNS = {
    "carried": -1.0,
    "turned": -1.0,
    "limit": 0.4,
    "slip": -5.0,
    "tilt": -3.0,
    "pad_force": 1.0,
    "patch_area": 0.015,
    "lift": 0.3,
    "end_time": 0.4,
}
