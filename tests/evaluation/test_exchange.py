"""Grasps of one file in the frame that another file wants: by hand, and there and back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from burg_drake.core import (
    GraspSet,
    InvalidInputError,
    UnknownNameError,
    grasp_from_axes,
    make_pose,
)
from burg_drake.evaluation import SeenScene, read_in_frame
from burg_drake.formats import write_grasp_file
from burg_drake.scene import Scene

X_SC = make_pose(Rotation.from_euler("xyz", [170, 10, 30], degrees=True).as_matrix(), (0.3, 0, 0.6))
"""A camera above the scene."""
CENTRES = {"left": (0.1, 0.2, 0.025), "right": (0.3, 0.2, 0.025), "bar": (0.2, 0.35, 0.015)}


@pytest.fixture
def grasps() -> GraspSet:
    """One at the centre of the cube, one 3 mm above that of the bar, each from above."""
    X = [
        grasp_from_axes((1.0, 0.2, 0.0), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0)),
        grasp_from_axes((0.0, 1.0, 0.0), (0.1, 0.0, -1.0), (0.0, 0.0, 0.003)),
    ]
    return GraspSet.create(X, object=["cube", "bar"], width=0.04, score=1.0)


@pytest.fixture
def file(grasps: GraspSet, tmp_path: Path) -> Path:
    grasps.save(tmp_path / "grasps.h5")
    return tmp_path / "grasps.h5"


def test_in_a_scene_grasps_are_on_every_instance(scene: Scene, file: Path) -> None:
    read = read_in_frame(file, "world", seen=SeenScene(scene=scene))
    instances = read.grasps.columns["instance"].tolist()
    assert (read.frame, sorted(instances)) == ("world", ["bar", "left", "right"])
    for X_SG, name in zip(read.grasps.X_OG, instances, strict=True):
        above = 0.003 if name == "bar" else 0.0
        np.testing.assert_allclose(X_SG[:3, 3], np.add(CENTRES[name], (0, 0, above)), atol=1e-12)


@pytest.mark.parametrize("ids", [{}, {4: "left", 5: "right", 9: "bar"}], ids=["held", "told"])
def test_through_a_camera_and_back(
    scene: Scene, grasps: GraspSet, file: Path, tmp_path: Path, ids: dict[int, str]
) -> None:
    seen = read_in_frame(file, "camera", seen=SeenScene(scene=scene, X_SF=X_SC, object_ids=ids))
    write_grasp_file(seen.grasps, tmp_path / "seen.npy", "graspnet")
    back = read_in_frame(
        tmp_path / "seen.npy", "object", seen=SeenScene(scene=scene, X_SF=X_SC, object_ids=ids)
    )
    assert sorted(back.grasps.columns["instance"].tolist()) == ["bar", "left", "right"]
    for X_OG, object in zip(back.grasps.X_OG, back.grasps.object, strict=True):
        np.testing.assert_allclose(X_OG, grasps.X_OG[grasps.object == object][0], atol=1e-6)


def test_object_ids_are_written(scene: Scene, file: Path) -> None:
    seen = read_in_frame(
        file, "camera", seen=SeenScene(scene=scene, X_SF=X_SC, object_ids={4: "left", 9: "bar"})
    )
    ids = dict(zip(seen.grasps.columns["instance"], seen.grasps.columns["object_id"], strict=True))
    assert ids == {"left": 4, "right": -1, "bar": 9}


def test_between_camera_and_scene_a_pose_is_enough(
    scene: Scene, file: Path, tmp_path: Path
) -> None:
    placed = read_in_frame(file, "world", seen=SeenScene(scene=scene)).grasps
    write_grasp_file(placed, tmp_path / "placed.csv")
    seen = read_in_frame(tmp_path / "placed.csv", "camera", seen=SeenScene(X_SF=X_SC)).grasps
    np.testing.assert_allclose(X_SC @ seen.X_OG, placed.X_OG, atol=1e-12)
    write_grasp_file(seen, tmp_path / "seen.npy", "graspnet")
    back = read_in_frame(tmp_path / "seen.npy", "world", seen=SeenScene(X_SF=X_SC)).grasps
    np.testing.assert_allclose(back.X_OG, placed.X_OG, atol=1e-6)


def test_the_same_frame_needs_no_scene(grasps: GraspSet, file: Path) -> None:
    read = read_in_frame(file, "object", objects={"cube": "dice"})
    assert read.grasps.object.tolist() == ["dice", "bar"]
    np.testing.assert_array_equal(read.grasps.X_OG, grasps.X_OG)


def test_what_is_missing_is_named(scene: Scene, file: Path, tmp_path: Path) -> None:
    with pytest.raises(
        InvalidInputError, match=r"in the frame of their object.*a scene.*the scene"
    ):
        read_in_frame(file, "world")
    with pytest.raises(InvalidInputError, match=r"frame of a camera need its pose"):
        read_in_frame(file, "camera", seen=SeenScene(scene=scene))
    write_grasp_file(GraspSet.load(file), tmp_path / "a.csv")
    with pytest.raises(InvalidInputError, match=r"in a scene.*a camera.*pose"):
        read_in_frame(tmp_path / "a.csv", "camera")
    with pytest.raises(UnknownNameError, match=r"object 'cuve'; did you mean 'cube'"):
        read_in_frame(file, "object", objects={"cuve": "dice"})
