"""Commanded grasps in the frames of displaced objects, and displaced scenes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from burg_drake.core import Array, GraspSet, InvalidInputError
from burg_drake.evaluation import Candidates, given_candidates
from burg_drake.experiment import (
    PlacementNoise,
    candidates_as_commanded,
    displaced_scene,
    grasps_as_commanded,
    move_on_board,
    noisy_scene,
)
from burg_drake.experiment.gap import displaced_scenes
from burg_drake.scene import Scene, SceneIssue, load_scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene("tabletop_six")


def random_pose(seed: int) -> Array:
    rng = np.random.default_rng(seed)
    X = np.eye(4)
    X[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    X[:3, 3] = rng.normal(size=3)
    return X


def test_the_hand_stays_where_it_was_told_to_go(scene: Scene) -> None:
    """World poses before and after are equal, calculated by numpy alone."""
    X_SO, X_OG = random_pose(1), np.stack([random_pose(2), random_pose(3)])
    now = displaced_scene(scene, {"mug": X_SO})
    X_OG_now = grasps_as_commanded(scene, now, "mug", X_OG)
    X_SO_text = now.instance("mug").X_SO.matrix()
    np.testing.assert_allclose(X_SO_text, X_SO, atol=1e-12)
    for there, here in zip(X_OG, X_OG_now, strict=True):
        np.testing.assert_allclose(
            np.linalg.solve(X_SO, scene.X_SO("mug") @ there), here, atol=1e-12
        )


def test_what_stands_as_planned_keeps_every_bit(scene: Scene) -> None:
    assert displaced_scene(scene, {name: scene.X_SO(name) for name in scene.instances}) is scene
    now = displaced_scene(scene, {"mug": random_pose(4)})
    X_OG = random_pose(5)
    assert grasps_as_commanded(scene, now, "box", X_OG) is X_OG
    assert now.content != scene.content and list(now.instances) == list(scene.instances)


def test_a_scene_that_moves_as_a_whole_with_its_grasps_is_not_displaced(scene: Scene) -> None:
    """The same rigid motion of objects and hand leaves the grasps as they are."""
    X_SS, X_OG = random_pose(6), random_pose(7)
    now = displaced_scene(scene, {name: X_SS @ scene.X_SO(name) for name in scene.instances})
    X_SG = X_SS @ scene.X_SO("bowl") @ X_OG
    back = np.linalg.inv(now.X_SO("bowl")) @ X_SG
    np.testing.assert_allclose(back, X_OG, atol=1e-12)


def test_candidates_keep_ids_and_all_but_their_poses(scene: Scene) -> None:
    sets = {
        name: GraspSet.create(np.stack([random_pose(8), random_pose(9)]), object=name, width=0.05)
        for name in ("mug", "box")
    }
    candidates = given_candidates(scene, sets)
    now = displaced_scene(scene, {"mug": random_pose(10)})
    found: Candidates = candidates_as_commanded(scene, now, candidates)
    assert found.id == candidates.id
    of_box = found.instance == "box"
    assert (found.grasps.X_OG[of_box] == candidates.grasps.X_OG[of_box]).all()
    assert not np.isclose(found.grasps.X_OG[~of_box], candidates.grasps.X_OG[~of_box]).all()


def test_errors_of_placement_are_normal_and_follow_from_content(scene: Scene) -> None:
    noise = PlacementNoise(place=0.002, turn=math.radians(2.0), seed=3)
    scenes = [noisy_scene(scene, noise, k, lambda _: ()).scene for k in range(60)]
    errors, turns = [], []
    for one in scenes:
        for name in scene.instances:
            entry = scene.entry(name)
            middle = (np.array(entry.lower) + np.array(entry.upper)) / 2
            there, here = scene.X_SO(name), one.X_SO(name)
            errors.append((here - there)[:3] @ [*middle, 1.0])
            turn = Rotation.from_matrix(here[:3, :3] @ there[:3, :3].T).as_rotvec()
            assert np.allclose(turn[:2], 0.0, atol=1e-9)
            turns.append(turn[2])
    xy = np.array(errors)
    assert np.abs(xy[:, 2]).max() < 1e-9
    # 360 draws: standard errors are 3.7 % of the deviation, and 5.3 % of it for the mean
    assert xy[:, :2].std(axis=0) == pytest.approx(0.002, rel=0.13)
    assert np.std(turns) == pytest.approx(math.radians(2.0), rel=0.13)
    assert np.abs(xy[:, :2].mean(axis=0)).max() < 4e-4
    again = noisy_scene(scene, noise, 7, lambda _: ()).scene
    assert again.content == scenes[7].content
    assert len({one.content for one in scenes}) == len(scenes)


def test_no_noise_is_the_scene_itself(scene: Scene) -> None:
    found = noisy_scene(scene, PlacementNoise(place=0.0, turn=0.0), 0, lambda _: ())
    assert found.scene is scene and found.redrawn == 0
    np.testing.assert_array_equal(move_on_board(scene, "mug", np.zeros(3), 0.0), scene.X_SO("mug"))
    with pytest.raises(InvalidInputError, match="noise of the turn is -1; give 0 or more"):
        PlacementNoise(turn=-1.0)


def test_what_collides_is_drawn_again_and_counted(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Half of the draws are rejected for a mug that may only stand further right."""
    x = scene.X_SO("mug")[0, 3]
    noise = PlacementNoise(turn=0.0)

    def issues(drawn: Scene) -> list[SceneIssue]:
        bad = drawn.X_SO("mug")[0, 3] < x
        issue = SceneIssue(instance="mug", kind="overlap", amount=0.01, message="", other="table")
        return [issue] if bad else []

    found = [noisy_scene(scene, noise, k, issues) for k in range(40)]
    assert all(one.scene.X_SO("mug")[0, 3] >= x for one in found)
    assert all(one.draws["box"] == 0 for one in found)
    # the number of refused draws is geometric: mean 1, variance 2
    assert 18 <= sum(one.redrawn for one in found) <= 70
    monkeypatch.setattr(displaced_scenes, "MAX_PLACEMENT_DRAWS", 5)
    never = noisy_scene(
        scene,
        noise,
        0,
        lambda drawn: issues(scene) if drawn.X_SO("mug")[0, 3] == x else issues_of("mug"),
    )
    assert never.kept == ("mug",) and never.draws["mug"] == 5


def issues_of(name: str) -> list[SceneIssue]:
    return [SceneIssue(instance=name, kind="overlap", amount=0.01, message="", other="table")]
