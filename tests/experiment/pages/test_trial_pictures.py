"""Pictures of grasps show the hand where the grasp is, and the target."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from burg_drake.experiment import HAND_BODY, NO_BODY, TARGET_RIM_COLOR, TrialPictures, TriedRuns

SMALL = (260, 195)


@pytest.fixture(scope="module")
def by_rays(runs: TriedRuns) -> TrialPictures:
    return TrialPictures(runs, rays=True)


def test_both_painters_see_the_same(
    runs: TriedRuns, pictures: TrialPictures, by_rays: TrialPictures
) -> None:
    for trial in (runs.sheet.trials[0], runs.sheet.trials[5]):
        (one, placed, view), (two, also, other) = (
            painter.paint_grasp(trial, SMALL) for painter in (pictures, by_rays)
        )
        assert np.array_equal(view.X_SC, other.X_SC)
        for name in (HAND_BODY, *runs.of(trial).scene.instances):
            a, b = one.visible_pixels(placed, name), two.visible_pixels(also, name)
            assert (a ^ b).sum() <= 0.02 * max(a.sum(), 1) + 40, name
        assert one.visible_pixels(placed, HAND_BODY).sum() > 1500


def test_hand_and_target_are_where_the_grasp_is(runs: TriedRuns, pictures: TrialPictures) -> None:
    for trial in runs.sheet.trials:
        painting, placed, view = pictures.paint_grasp(trial, SMALL)
        # A projection of its own: pinhole, pixel centres at integers, S to C.
        R, p = view.X_SC[:3, :3], view.X_SC[:3, 3]
        X_SG, half = runs.X_SG(trial), runs.width(trial) / 2 + 0.006
        hand = painting.visible_pixels(placed, HAND_BODY)
        away = cv2.distanceTransform((~hand).astype(np.uint8), cv2.DIST_L2, 5)
        for side in (-half, half):
            x, y, z = R.T @ ((X_SG @ [side, 0.0, -0.02, 1.0])[:3] - p)
            focal = SMALL[1] / 2 / 0.24
            u = focal * x / z + (SMALL[0] - 1) / 2
            v = focal * y / z + (SMALL[1] - 1) / 2
            assert 0 <= u < SMALL[0] and 0 <= v < SMALL[1]
            assert away[round(v), round(u)] < 12, trial.grasp
        target = painting.visible_pixels(placed, trial.instance)
        assert target.sum() > 400, trial.grasp
        assert (painting.owner == NO_BODY).mean() < 0.6


def test_the_target_has_a_rim(runs: TriedRuns, pictures: TrialPictures) -> None:
    trial = runs.sheet.trials[2]
    painting, placed, _ = pictures.paint_grasp(trial, SMALL)
    data = np.frombuffer(pictures.grasp(trial, SMALL), np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_COLOR)[..., ::-1].astype(int)
    orange = np.abs(image - TARGET_RIM_COLOR).max(axis=2) < 70
    mask = painting.visible_pixels(placed, trial.instance).astype(np.uint8)
    near = cv2.dilate(mask, np.ones((9, 9))) > 0
    assert orange[near].sum() > 60
    assert orange[~near].sum() < 0.1 * orange[near].sum()


@pytest.mark.thorough
def test_pictures_follow_from_the_grasps_alone(
    runs: TriedRuns, pictures: TrialPictures, by_rays: TrialPictures
) -> None:
    seen = [pictures.grasp(trial, SMALL) for trial in runs.sheet.trials[:3]]
    assert len(set(seen)) == len(seen)
    assert pictures.grasp(runs.sheet.trials[0], SMALL) == seen[0]  # others came between
    assert TrialPictures(runs, rays=True).grasp(runs.sheet.trials[1], SMALL) == by_rays.grasp(
        runs.sheet.trials[1], SMALL
    )
    assert len(pictures.grasp(runs.sheet.trials[0])) < 40_000
    above, front = pictures.setup(runs.sheet.trials[0])
    assert above != front and max(len(above), len(front)) < 80_000
