"""Candidates: what is sampled follows from content, what is given is checked."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core.errors import InvalidInputError, UnknownNameError
from burg_drake.core.frames import make_pose
from burg_drake.core.grasps import GraspSet
from burg_drake.evaluation.candidates import Candidates, given_candidates, sample_candidates
from burg_drake.scene.scene import Scene
from burg_drake.station.station import Station


def only(scene: Scene, *names: str) -> Scene:
    """The scene without the other instances."""
    kept = tuple(i for i in scene.document.instances if (i.name or i.object) in names)
    return Scene(dataclasses.replace(scene.document, instances=kept), scene.library, scene.path)


def of(candidates: Candidates, instance: str) -> list[str]:
    return candidates.grasps.id[candidates.instance == instance].tolist()


def test_instances_of_an_object_get_the_same_grasps(scene: Scene, station: Station) -> None:
    sampled = sample_candidates(scene, station, 20, seed=0)
    assert len(sampled) == 60 and len(set(sampled.id)) == 60
    assert of(sampled, "left") == of(sampled, "right") != of(sampled, "bar")
    assert sampled.id[0] == f"left-{sampled.grasps.id[0]}"


def test_what_else_is_in_the_scene_does_not_matter(scene: Scene, station: Station) -> None:
    everything = sample_candidates(scene, station, 20, seed=0)
    alone = sample_candidates(only(scene, "bar"), station, 20, seed=0)
    assert of(everything, "bar") == of(alone, "bar")
    assert of(everything, "bar") != of(sample_candidates(scene, station, 20, seed=1), "bar")
    assert len(sample_candidates(only(scene), station, 20, seed=0)) == 0


def test_the_hand_opens_wide_enough(scene: Scene, station: Station) -> None:
    grasps = sample_candidates(only(scene, "bar"), station, 200, seed=0).grasps
    # the bar is 0.03 x 0.03 x 0.2 m, and the hand opens 0.08 m
    assert grasps.width.min() >= 0.03 - 1e-9
    assert grasps.width.max() < 0.08


def test_a_file_gives_back_every_bit(tmp_path: Path, scene: Scene, station: Station) -> None:
    sampled = sample_candidates(scene, station, 5, seed=0)
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


def test_given_grasps_must_fit_the_scene(scene: Scene) -> None:
    grasps = GraspSet.create(np.eye(4), object="cube")
    with pytest.raises(UnknownNameError, match=r"'righ', which is not a free .* mean 'right'"):
        given_candidates(scene, {"righ": grasps})
    with pytest.raises(
        InvalidInputError, match=r"given for 'bar' belong to object 'cube'; .*'bar'"
    ):
        given_candidates(scene, {"bar": grasps})
    with pytest.raises(InvalidInputError, match="grasps per object is 0"):
        sample_candidates(scene, None, 0, seed=0)  # type: ignore[arg-type]
