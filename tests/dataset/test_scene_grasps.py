"""Grasps of runs and of the sampler, in the frame of a camera and in voxels."""

from __future__ import annotations

import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import (
    InvalidInputError,
    Outcome,
    Pose,
    UnknownNameError,
    make_pose,
    rotation_from_quaternion,
    rotation_from_rpy,
)
from burg_drake.dataset import (
    LabelledGrasps,
    SceneGrasps,
    grasps_of_run,
    label_grasps,
    sampled_grasps,
    volume_grasps,
)
from burg_drake.evaluation import JOURNAL_FILE, Campaign, Run, load_run
from burg_drake.scene import Instance, load_scene
from burg_drake.station import load_station

sys.path.insert(0, str(Path(__file__).parents[1] / "evaluation"))


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """Three scenes, of which the first two have the same objects at different places, judged by a
    judge whose outcomes follow from the ids of grasps."""
    import known_judge
    from known_many import empty_pages, run_all, write_scenes

    folder = tmp_path_factory.mktemp("many")
    with pytest.MonkeyPatch.context() as patch:
        known_judge.install(patch.setattr)
        empty_pages(patch.setattr)
        return run_all(write_scenes(folder), load_station("panda_tabletop"), folder / "all")


@pytest.fixture
def run(campaign: Campaign) -> Run:
    return campaign.run("cubes")


def test_grasps_of_a_run_are_its_table(run: Run) -> None:
    grasps = grasps_of_run(run.path, run.scene())
    table = run.results
    assert len(grasps) == len(table["id"]) == 10
    assert grasps.instance.tolist() == table["instance"].tolist()
    assert grasps.outcome.tolist() == table["outcome"].tolist()
    for name in ("slip", "clearance", "lift"):
        np.testing.assert_array_equal(grasps.margins[name], table[name])
    np.testing.assert_array_equal(grasps.width, table["width"])
    np.testing.assert_allclose(grasps.X_OG[:, 0, 3], table["x"])
    assert "cpu_clear" not in grasps.margins and "moved_left" not in grasps.margins


def test_what_is_not_judged_is_there(run: Run, tmp_path: Path) -> None:
    shutil.copytree(run.path, tmp_path / "run")
    journal = tmp_path / "run" / JOURNAL_FILE
    journal.write_text("".join(journal.read_text().splitlines(keepends=True)[:-4]))
    grasps = grasps_of_run(load_run(tmp_path / "run"), run.scene())
    open_ones = grasps.outcome == ""
    assert len(grasps) == 10 and open_ones.sum() == 4
    assert np.isnan(grasps.margins["overlap"][open_ones]).all()
    whole = grasps_of_run(run, run.scene())
    assert grasps.outcome[~open_ones].tolist() == whole.outcome[~open_ones].tolist()


def test_the_scene_of_a_run_over_many(campaign: Campaign) -> None:
    for one in campaign.runs:
        grasps = grasps_of_run(campaign.path, one.scene())
        np.testing.assert_array_equal(grasps.X_OG, one.candidates.grasps.X_OG)
        assert grasps.outcome.tolist() == one.results["outcome"].tolist()


def test_a_run_of_another_scene_is_refused(campaign: Campaign, run: Run) -> None:
    other = campaign.run("moved").scene()
    with pytest.raises(InvalidInputError, match=r"is a run of scene 'cubes' .*, not of 'moved' "):
        grasps_of_run(run, other)
    gone = replace(other, document=replace(other.document, instances=other.document.instances[:1]))
    with pytest.raises(InvalidInputError, match=r"no scene with .* 'moved' .*cubes, moved, three"):
        grasps_of_run(campaign, gone)


def test_the_camera_has_them_at_their_places() -> None:
    scene = load_scene("tabletop_six")
    fixed = Instance(name="fixed", object="box", X_SO=Pose((0.1, 0.0, 0.3)))
    scene = replace(scene, document=replace(scene.document, background=(fixed,)))
    names = [*scene.instances, "fixed"]
    rng = np.random.default_rng(0)
    X_OG = make_pose(rotation_from_rpy(rng.normal(size=(7, 3))), rng.normal(size=(7, 3)))
    order = rng.permutation(7)
    grasps = SceneGrasps(
        X_OG,
        np.array(names)[order],
        np.arange(7.0),
        np.full(7, "lifted"),
        {"slip": np.arange(7.0)},
    )
    X_SC = make_pose(rotation_from_rpy((0.1, 2.0, -1.0)), (0.5, 0.4, 1.0))
    seen = label_grasps(grasps, scene, X_SC)
    for k in range(7):
        np.testing.assert_allclose(
            X_SC @ seen.X_CG[k], scene.X_SO(names[order[k]]) @ X_OG[k], atol=1e-12
        )
    assert seen.number.tolist() == (order + 1).tolist()
    np.testing.assert_array_equal(seen.margins["slip"], seen.width)
    with pytest.raises(UnknownNameError, match="has no 'cup'"):
        label_grasps(replace(grasps, instance=np.full(7, "cup")), scene, X_SC)
    with pytest.raises(InvalidInputError, match=r"width of grasps has shape \(6,\)"):
        replace(grasps, width=np.zeros(6))


def test_sampled_grasps_have_the_words_of_a_run() -> None:
    """Where the open hand collides, Drake's own query finds the body that the outcome speaks of;
    elsewhere it finds none."""
    from burg_drake.grasping import HandClearance
    from burg_drake.station import build_station_diagram

    scene = load_scene("tabletop_six")
    names = ("mug", "box")
    chosen = tuple(map(scene.instance, names))
    scene = replace(scene, document=replace(scene.document, instances=chosen))
    grasps = sampled_grasps(scene, "panda_tabletop", 8, seed=3)
    assert grasps.instance.tolist() == 8 * ["mug"] + 8 * ["box"]
    assert {""} < set(grasps.outcome.tolist())
    assert {Outcome(text).stage for text in grasps.outcome.tolist() if text} == {"clear"}
    diagram = build_station_diagram(scene, "panda_tabletop", robot="hand")
    screen = HandClearance(diagram)
    for k, (name, outcome) in enumerate(zip(grasps.instance, grasps.outcome, strict=True)):
        touched = screen.touched(diagram.X_WO(name) @ grasps.X_OG[k])
        other = names[1 - names.index(name)]
        body = {"": None, "collision_target": name, "collision_table": "table"}.get(outcome, other)
        assert (not touched) if body is None else (body in touched)
    clear = grasps.outcome == ""
    assert (grasps.margins["clearance"][clear] > -1e-5).all()
    assert (grasps.margins["overlap"][~clear] > 0.0).all()
    again = sampled_grasps(scene, "panda_tabletop", 8, seed=3)
    np.testing.assert_array_equal(again.X_OG, grasps.X_OG)


def test_voxels_of_grasps() -> None:
    outcome = np.array(
        ["lifted", "slipped", "lifted_disturbed", "", "reachable", "simulation_failed", "no_ik",
         "lifted"]
    )  # fmt: skip
    rng = np.random.default_rng(5)
    R = rotation_from_rpy(rng.normal(size=(8, 3)))
    p = np.tile([0.01, 0.02, 0.299], (8, 1))
    p[2], p[7] = (0.2, 0.1, 0.0), (0.1, 0.1, 0.301)
    X_CV = make_pose(rotation_from_rpy((0.5, 0.6, 0.7)), (0.3, 0.2, 0.9))
    width = np.array([0.03, 0.03, np.nan, 0.03, 0.03, 0.03, 0.03, 0.03])
    grasps = LabelledGrasps(X_CV @ make_pose(R, p), width, np.ones(8, np.uint16), outcome, {})
    found = volume_grasps(grasps, X_CV)
    assert found.grasp.tolist() == [0, 1, 2, 6]
    assert found.success.tolist() == [True, False, True, False]
    assert found.untried.tolist() == [3, 4, 5] and found.outside.tolist() == [7]
    assert found.voxel.tolist() == [[1, 2, 39], [1, 2, 39], [26, 13, 0], [1, 2, 39]]
    np.testing.assert_allclose(found.width, [4.0, 4.0, np.nan, 4.0])
    turned = rotation_from_quaternion(found.rotation)
    np.testing.assert_allclose(turned[:, 0], R[found.grasp], atol=1e-12)
    np.testing.assert_allclose(turned[:, 1], R[found.grasp] * [-1, -1, 1], atol=1e-12)
    targets = found.targets()
    assert targets.quality[1, 2, 39] == pytest.approx(1 / 3) and targets.quality[26, 13, 0] == 1.0
    assert np.isfinite(targets.quality).sum() == 2
    np.testing.assert_allclose(targets.rotation[1, 2, 39], found.rotation[0, 0], atol=1e-6)
    assert targets.width[1, 2, 39] == 4.0 and np.isnan(targets.width[0, 0, 0])
