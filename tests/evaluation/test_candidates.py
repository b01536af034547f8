"""Candidates: what is sampled follows from content, what is given is checked."""

from __future__ import annotations

import dataclasses
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import GraspSet, InvalidInputError, Pose, UnknownNameError, make_pose
from burg_drake.evaluation import (
    Candidates,
    SamplingSettings,
    given_candidates,
    read_grasps,
    sample_candidates,
)
from burg_drake.scene import Scene
from burg_drake.station import Station

BLIND = SamplingSettings(blind=True)
"""The objects of the small scene are nothing to Drake."""


def from_above(angle: float) -> SamplingSettings:
    return SamplingSettings(blind=True, approach_angle_deg=angle)


def only(scene: Scene, *names: str) -> Scene:
    """The scene without the other instances."""
    kept = tuple(i for i in scene.document.instances if (i.name or i.object) in names)
    return Scene(dataclasses.replace(scene.document, instances=kept), scene.library, scene.path)


def of(candidates: Candidates, instance: str) -> list[str]:
    return candidates.grasps.id[candidates.instance == instance].tolist()


def test_instances_of_an_object_get_the_same_grasps(scene: Scene, station: Station) -> None:
    sampled = sample_candidates(scene, station, 20, 0, BLIND)
    assert len(sampled) == 60 and len(set(sampled.id)) == 60
    assert of(sampled, "left") == of(sampled, "right") != of(sampled, "bar")
    assert sampled.id[0] == f"left-{sampled.grasps.id[0]}"


def test_what_else_is_in_the_scene_does_not_matter(scene: Scene, station: Station) -> None:
    everything = sample_candidates(scene, station, 20, 0, BLIND)
    alone = sample_candidates(only(scene, "bar"), station, 20, 0, BLIND)
    assert of(everything, "bar") == of(alone, "bar")
    assert of(everything, "bar") != of(sample_candidates(scene, station, 20, 1, BLIND), "bar")
    assert len(sample_candidates(only(scene), station, 20, 0, BLIND)) == 0


def posed(scene: Scene, **rpy_deg: tuple[float, float, float]) -> Scene:
    """The scene with instances turned."""
    instances = tuple(
        dataclasses.replace(i, X_SO=Pose(i.X_SO.translation, rpy_deg=rpy_deg[name]))
        if (name := i.name or i.object) in rpy_deg
        else i
        for i in scene.document.instances
    )
    return Scene(
        dataclasses.replace(scene.document, instances=instances), scene.library, scene.path
    )


@pytest.mark.parametrize("angle", [20.0, 75.0, 90.0, 120.0])
def test_the_hand_comes_from_above(scene: Scene, station: Station, angle: float) -> None:
    turned = posed(scene, left=(30.0, 40.0, 50.0), bar=(0.0, -90.0, 10.0))
    tilted = Pose((0.4, 0.1, 0.0), rpy_deg=(0.0, 25.0, 70.0))  # a board that is not level
    document = dataclasses.replace(station.document, X_WS=tilted)
    sloping = dataclasses.replace(station, document=document)
    sampled = sample_candidates(turned, sloping, 200, 0, from_above(angle))
    assert len(sampled) == 600
    for name in turned.instances:
        X_OG = sampled.grasps.X_OG[sampled.instance == name]
        approach = (tilted.matrix() @ turned.X_SO(name) @ X_OG)[:, :3, 2]
        from_down = np.degrees(np.arccos(np.clip(-approach[:, 2], -1.0, 1.0)))
        assert 0.85 * angle < from_down.max() <= angle + 1e-3


def test_objects_on_the_same_side_get_the_same_grasps(scene: Scene, station: Station) -> None:
    about_vertical = sample_candidates(posed(scene, right=(0, 0, 77.7)), station, 20, 0, BLIND)
    assert of(about_vertical, "left") == of(about_vertical, "right")
    tipped = sample_candidates(posed(scene, right=(90, 0, 0)), station, 20, 0, BLIND)
    assert of(tipped, "left") == of(about_vertical, "left")
    assert not set(of(tipped, "left")) & set(of(tipped, "right"))
    anywhere = sample_candidates(posed(scene, right=(90, 0, 0)), station, 20, 0, from_above(180.0))
    assert of(anywhere, "left") == of(anywhere, "right")


def test_the_hand_opens_wide_enough(scene: Scene, station: Station) -> None:
    grasps = sample_candidates(only(scene, "bar"), station, 200, 0, BLIND).grasps
    # the bar is 0.03 x 0.03 x 0.2 m, and the hand opens 0.08 m
    assert grasps.width.min() >= 0.03 - 1e-9
    assert grasps.width.max() < 0.08


def test_a_file_gives_back_every_bit(tmp_path: Path, scene: Scene, station: Station) -> None:
    sampled = sample_candidates(scene, station, 5, 0, BLIND)
    sampled.save(tmp_path / "grasps.npz")
    back = Candidates.load(tmp_path / "grasps.npz")
    assert back.id == sampled.id and back.content == sampled.content
    np.testing.assert_array_equal(back.grasps.X_OG, sampled.grasps.X_OG)
    assert back.grasps.provenance == sampled.grasps.provenance
    assert sampled.grasps.provenance["parts"]["bar"]["sampler"] == "antipodal"
    sampled.grasps.save(tmp_path / "other.npz")
    with pytest.raises(InvalidInputError, match="which instance"):
        Candidates.load(tmp_path / "other.npz")


def test_given_grasps_are_used_as_they_are(scene: Scene) -> None:
    X_OG = make_pose(p_AB=[[0, 0, 0.1], [0, 0, 0.2], [0, 0, 0.1]])
    given = given_candidates(scene, {"right": GraspSet.create(X_OG, object="cube")})
    assert given.instance.tolist() == ["right", "right"]  # the third is the first again
    np.testing.assert_array_equal(given.grasps.X_OG, X_OG[:2])
    assert given.counts == {"right": 2}
    assert given_candidates(scene, {}).counts == {}


def test_grasps_with_equal_hashes_are_not_taken_for_equal(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    X_OG = make_pose(p_AB=[[0, 0, 0.1], [0, 0, 0.2], [0, 0, 0.1]])
    grasps = GraspSet.create(X_OG, object="cube").with_columns(instance="elsewhere")
    monkeypatch.setattr(sys.modules[Candidates.__module__], "hash", lambda _: 7, raising=False)
    given = given_candidates(scene, {"right": grasps, "left": grasps.select([1])})
    assert given.counts == {"left": 1, "right": 2}
    assert given.rows(given.id).tolist() == [0, 1, 2]
    assert not given.grasps.columns  # the mapping says on which instance the grasps are


def test_given_grasps_must_fit_the_scene(scene: Scene) -> None:
    grasps = GraspSet.create(np.eye(4), object="cube")
    with pytest.raises(UnknownNameError, match=r"'righ', which is not a free .* mean 'right'"):
        given_candidates(scene, {"righ": grasps})
    with pytest.raises(InvalidInputError, match="'bar' are of object 'cube'"):
        given_candidates(scene, {"bar": grasps})
    with pytest.raises(InvalidInputError, match="grasps per object is 0"):
        sample_candidates(scene, None, 0, 0, BLIND)  # type: ignore[arg-type]


@pytest.mark.parametrize("angle", [0.0, -10.0, 180.5, np.nan])
def test_an_approach_angle_out_of_range(scene: Scene, station: Station, angle: float) -> None:
    message = f"^approach angle is {angle:g} degrees; give more than 0, at most 180$"
    with pytest.raises(InvalidInputError, match=message):
        sample_candidates(scene, station, 5, 0, from_above(angle))


def test_grasps_of_a_run_stay_on_their_instances(
    tmp_path: Path, scene: Scene, station: Station
) -> None:
    sampled = sample_candidates(posed(scene, right=(90, 0, 0)), station, 5, 0, BLIND)
    sampled.save(tmp_path / "grasps.npz")
    back = given_candidates(scene, read_grasps(scene, tmp_path / "grasps.npz").by_instance)
    assert back.id == sampled.id and back.content == sampled.content
    assert back.grasps.provenance == sampled.grasps.provenance
    given_candidates(scene, {}).save(tmp_path / "none.npz")
    assert read_grasps(scene, tmp_path / "none.npz").by_instance == {}
    with pytest.raises(UnknownNameError, match="'left', which is not a free instance"):
        back = read_grasps(scene, tmp_path / "grasps.npz").by_instance
        given_candidates(only(scene, "bar"), back)


def test_other_grasps_go_to_all_instances_of_their_object(tmp_path: Path, scene: Scene) -> None:
    X_OG = make_pose(p_AB=[[0, 0, 0.1], [0, 0, 0.2]])
    GraspSet.create(X_OG, object="cube").save(tmp_path / "cube.npz")
    given = given_candidates(scene, read_grasps(scene, tmp_path / "cube.npz").by_instance)
    assert given.instance.tolist() == ["left", "left", "right", "right"]
    GraspSet.create(X_OG, object="cub").save(tmp_path / "cub.npz")
    with pytest.raises(UnknownNameError, match=r"cub.npz has grasps of object 'cub', .* 'cube'"):
        read_grasps(scene, tmp_path / "cub.npz")


def test_rows_are_found_in_another_process() -> None:
    """Texts have other hashes there."""
    candidates = given(4)
    assert candidates.rows(candidates.id).tolist() == [0, 1, 2, 3]
    found = subprocess.run(
        [sys.executable, "-c", FIND_ROWS],
        input=pickle.dumps(candidates),
        capture_output=True,
        env=os.environ | {"PYTHONHASHSEED": "7"},
        check=True,
    )
    assert found.stdout.decode().strip() == "[0, 1, 2, 3]"


FIND_ROWS = """
import pickle, sys
candidates = pickle.load(sys.stdin.buffer)
print(candidates.rows(candidates.id).tolist())
"""


def given(count: int) -> Candidates:
    X_OG = np.tile(np.eye(4), (count, 1, 1))
    X_OG[:, 0, 3] = 0.01 * np.arange(count)
    return Candidates(GraspSet.create(X_OG, object="box"), np.full(count, "box"))
