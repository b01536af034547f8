"""Conditions that differ from those of a suite: noise of the depth, the camera's pose, friction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from burg_drake.benchmark import (
    CameraPlacement,
    Conditions,
    Observation,
    all_tables,
    compare_by_suite,
    condition_effects,
)
from burg_drake.core import FieldError
from burg_drake.station import load_station
from tests.benchmark.can_scenes import cans
from tests.benchmark.judged import LIFTED, SLIPPED, judged, result


def observed(conditions: Conditions | None = None, **camera: object) -> Observation:
    scene, station = cans("can", (0.3, 0.2)), load_station("panda_tabletop")
    placed = replace(CameraPlacement().camera(scene.board), color=False, size=(212, 120), **camera)
    return placed.scene_camera(conditions).observe(scene, station)


def test_twice_the_depth_noise_has_twice_the_deviation() -> None:
    exact = observed(noise=False).depth
    errors = [observed(Conditions(depth_noise=factor)).depth - exact for factor in (1.0, 2.0)]
    seen = [np.abs(e[(e + exact > 0.0) & (exact > 0.0)]) for e in errors]
    # The median leaves out flying pixels, which stay as they are.
    assert np.median(seen[1]) == pytest.approx(2.0 * np.median(seen[0]), rel=0.1)


def test_the_told_pose_is_off_by_the_asked_deviation_and_the_image_is_the_same() -> None:
    usual = observed()
    shifts, turns = [], []
    for k in range(20):
        found = observed(Conditions(camera_shift=0.004, camera_turn=0.01), name=f"camera_{k}")
        error = np.linalg.inv(usual.X_WC) @ found.X_WC
        shifts.append(error[:3, 3])
        turns.append([error[2, 1], error[0, 2], error[1, 0]])
    # 60 normal numbers: the deviation is known to 9 %.
    assert np.std(shifts) == pytest.approx(0.004, rel=0.3)
    assert np.std(turns) == pytest.approx(0.01, rel=0.3)
    found = observed(Conditions(camera_shift=0.004))
    assert np.array_equal(found.depth, usual.depth)
    assert found.id == observed(Conditions(camera_shift=0.004)).id != usual.id
    larger = observed(Conditions(camera_shift=0.008))
    moved = [one.X_WC[:3, 3] - usual.X_WC[:3, 3] for one in (found, larger)]
    assert moved[1] == pytest.approx(2.0 * moved[0])


def test_conditions_are_told_in_words() -> None:
    assert str(Conditions()) == "as in the suite"
    changed = Conditions(depth_noise=2.0, camera_turn=np.deg2rad(0.5))
    assert str(changed) == "depth noise x 2, camera turn 0.5 deg"
    with pytest.raises(FieldError, match="friction"):
        Conditions(friction=0.0)


def test_the_effect_of_a_condition_is_that_on_the_same_scenes() -> None:
    def made(lifted: int, name: str = "mine", **conditions: float) -> object:
        answers = [judged(f"s{k}", [LIFTED if k < lifted else SLIPPED]) for k in range(10)]
        found = result(answers, name, grasps=1)
        document = replace(found.document, conditions=Conditions(**conditions))
        changed = type(found)(found.path / str(conditions), document, found.suite)
        changed.__dict__["answers"] = found.answers
        return changed

    noisy, slippery = made(2, depth_noise=4.0), made(7, friction=0.5)
    alone = made(5, "other", friction=0.5)
    comparisons = compare_by_suite([made(9), noisy, slippery, alone])
    effects = {str(e.result.document.conditions): e for e in condition_effects(comparisons)}
    assert list(effects) == ["depth noise x 4", "friction x 0.5"]
    found = effects["depth noise x 4"].difference
    assert found.difference == pytest.approx(-0.7)
    assert found.p_value == pytest.approx(2 / 2**7)  # seven scenes, all for the worse
    assert found.corrected == pytest.approx(2 * found.p_value)
    tables = all_tables(comparisons)
    assert tables[-1].title == "Robustness" and len(tables[-1].rows) == 2
    # Conditions under which a method has no counterpart have tables of their own.
    assert any("friction x 0.5" in table.title for table in tables)
    assert not any("depth noise" in table.title for table in tables)
