"""The robust fit: exact where it can be, calm about outliers, honest about its errors."""

from __future__ import annotations

import numpy as np

from burg_drake.cameras import fit_displacement

UNIT = np.array([1e-3, 1e-3, 1e-2])
STEP = np.array([0.002, -0.001, 0.01])


def measurements(rng: np.random.Generator, n: int = 300) -> tuple[np.ndarray, np.ndarray]:
    way = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
    along = np.column_stack([np.cos(way), np.sin(way), 0.03 * np.sin(3 * way + 1)]) * 700.0
    return along, np.floor(way / (2 * np.pi) * 36).astype(int)


def test_exact_measurements_with_outliers_give_the_exact_step() -> None:
    along, groups = measurements(np.random.default_rng(0))
    offset = along @ STEP
    offset[::4] += 8.0
    solved = fit_displacement(along, offset, np.full(300, 0.2), groups, False, UNIT)
    assert solved is not None
    np.testing.assert_allclose(solved.step, STEP, atol=1e-9)
    assert (solved.weights[::4] == 0.0).all()


def test_deviations_are_those_of_repeated_measurements() -> None:
    rng = np.random.default_rng(1)
    along, groups = measurements(rng)
    # half of each error is common to the neighbours
    errors, said = [], []
    for _ in range(300):
        common = rng.normal(0.0, 0.2, 37)[groups]
        offset = along @ STEP + common + rng.normal(0.0, 0.2, 300)
        solved = fit_displacement(along, offset, np.full(300, 0.3), groups, False, UNIT)
        assert solved is not None
        errors.append(solved.step - STEP)
        said.append(np.diag(solved.covariance))
    true, claimed = np.std(errors, axis=0), np.sqrt(np.mean(said, axis=0))
    assert (claimed > 0.9 * true).all()
    assert (claimed < 1.4 * true).all()


def test_the_gain_says_how_a_measurement_moves_the_result() -> None:
    along, groups = measurements(np.random.default_rng(2))
    deviation = np.full(300, 0.2)
    offset = along @ STEP
    base = fit_displacement(along, offset, deviation, groups, False, UNIT)
    offset[17] += 1e-3
    moved = fit_displacement(along, offset, deviation, groups, False, UNIT)
    assert base is not None
    assert moved is not None
    np.testing.assert_allclose(
        moved.step - base.step, base.sensitivity[:, 17] * 1e-3, rtol=1e-3, atol=1e-12
    )


def test_a_symmetric_object_keeps_its_angle() -> None:
    along, groups = measurements(np.random.default_rng(3))
    offset = along[:, :2] @ STEP[:2]
    solved = fit_displacement(along, offset, np.full(300, 0.2), groups, True, UNIT)
    assert solved is not None
    np.testing.assert_allclose(solved.step, [*STEP[:2], 0.0], atol=1e-9)
    assert solved.covariance[2, 2] == 0.0


def test_edges_that_all_run_one_way_determine_nothing() -> None:
    along = np.tile([700.0, 0.0, 0.0], (100, 1))
    assert fit_displacement(along, np.ones(100), np.ones(100), np.arange(100), False, UNIT) is None
    few = np.eye(3)
    assert fit_displacement(few, np.ones(3), np.ones(3), np.arange(3), False, UNIT) is None


def test_another_unknown_takes_what_it_explains() -> None:
    along, groups = measurements(np.random.default_rng(4))
    along = along[:100]  # a third of the circle: growing looks like moving
    offset = along @ STEP + 0.15
    plain = fit_displacement(along, offset, np.full(100, 0.05), groups[:100], False, UNIT)
    aware = fit_displacement(
        along, offset, np.full(100, 0.05), groups[:100], False, UNIT, np.full((100, 1), 0.15)
    )
    assert plain is not None
    assert aware is not None
    assert np.abs(aware.step - STEP)[:2].max() < 0.3 * np.abs(plain.step - STEP)[:2].max()
