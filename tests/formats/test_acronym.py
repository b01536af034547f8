"""Files in the layout of acronym_tools/acronym.py, which has its own reader transcribed here."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from burg_drake.core import Array, GraspSet, InvalidInputError
from burg_drake.formats import PANDA_GRIPPER, acronym

MOTIONS = [
    "object_motion_during_closing_angular",
    "object_motion_during_closing_linear",
    "object_motion_during_shaking_angular",
    "object_motion_during_shaking_linear",
]


def dataset_file(path: Path, T: Any, success: Any, **changed: Any) -> Path:
    """A file as the data set has them."""
    n = len(success)
    rng = np.random.default_rng(1)
    values: dict[str, Any] = {
        "object/file": "meshes/Mug/10f6e09036350e92b3f21f1137c3c347.obj",
        "object/scale": 0.0002682457830986903,
        "object/mass": 0.25,
        "object/friction": 0.5,
        "object/density": 150.0,
        "object/volume": 0.00017,
        "object/com": np.array([0.0, 0.01, 0.03]),
        "object/inertia": np.diag([1e-4, 1e-4, 2e-4]),
        "gripper/type": "panda",
        "gripper/configuration": np.array([0.04, 0.04]),
        "grasps/transforms": T,
        "grasps/qualities/flex/object_in_gripper": success,
        **{f"grasps/qualities/flex/{name}": rng.random(n) for name in MOTIONS},
    }
    with h5py.File(path, "w") as file:
        for key, value in {**values, **changed}.items():
            if value is not None:
                file[key] = value
    return path


def load_grasps(path: Path) -> tuple[Array, Any]:
    """The data set's own reader."""
    data = h5py.File(path, "r")
    return np.array(data["grasps/transforms"]), np.array(
        data["grasps/qualities/flex/object_in_gripper"]
    )


# Straight down on a cube: the gripper's base 0.1034 m above the centre, its z down, x along y.
DOWN = np.array(
    [[0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.1034], [0.0, 0.0, 0.0, 1.0]]
)


def test_a_grasp_on_a_cube_written_by_hand(
    tmp_path: Path, assert_grips_the_cube: Callable[[Array], None]
) -> None:
    read = acronym.read_acronym(dataset_file(tmp_path / "a.h5", DOWN[None], [1]), PANDA_GRIPPER)
    assert read.frame == "object"
    assert_grips_the_cube(read.grasps.X_OG[0])
    # create_gripper_marker of the data set draws the tips at (+-0.041, 0, 0.11217) of the gripper
    tips = DOWN @ np.array([[0.041, 0.0, 0.11217, 1.0], [-0.041, 0.0, 0.11217, 1.0]]).T
    in_grasp = np.linalg.inv(read.grasps.X_OG[0]) @ tips
    np.testing.assert_allclose(in_grasp[:2], [[0.041, -0.041], [0.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(in_grasp[2], PANDA_GRIPPER.tip, atol=1e-3)


def test_values_of_a_file_arrive(tmp_path: Path, random_grasps: Callable[..., GraspSet]) -> None:
    T = random_grasps(7, 3).X_OG
    success = np.array([1, 0, 1, 1, 0, 0, 1])
    path = dataset_file(tmp_path / "Mug_10f6_0.00027.h5", T, success)
    read = acronym.read_acronym(path, PANDA_GRIPPER)
    grasps = read.grasps
    name = "10f6e09036350e92b3f21f1137c3c347"
    assert set(grasps.object.tolist()) == {name}
    np.testing.assert_array_equal(grasps.score, success)
    assert np.isnan(grasps.width).all()
    assert set(grasps.columns) == set(MOTIONS)
    rng = np.random.default_rng(1)
    for motion in MOTIONS:
        np.testing.assert_array_equal(grasps.columns[motion], rng.random(7))
    described = grasps.provenance["object_files"][name]
    assert described["file"] == f"meshes/Mug/{name}.obj"
    assert described["scale"] == 0.0002682457830986903
    assert described["mass"] == 0.25 and described["com"] == [0.0, 0.01, 0.03]
    assert any("scaled by 0.000268" in note for note in read.notes)


def test_single_precision_is_read(tmp_path: Path, random_grasps: Callable[..., GraspSet]) -> None:
    T = random_grasps(20, 4).X_OG
    path = dataset_file(tmp_path / "a.h5", T.astype(np.float32), np.ones(20, bool))
    found = acronym.read_acronym(path, PANDA_GRIPPER).grasps.X_OG
    np.testing.assert_allclose(found[:, :3, :3], T[:, :3, :3], atol=1e-6)
    R = found[:, :3, :3]
    np.testing.assert_allclose(
        np.swapaxes(R, 1, 2) @ R, np.broadcast_to(np.eye(3), R.shape), atol=1e-14
    )


def test_written_files_are_read_by_the_data_set_s_own_tools(
    tmp_path: Path, random_grasps: Callable[..., GraspSet]
) -> None:
    grasps = random_grasps(9, 5, success=True)
    notes = acronym.write_acronym(grasps, tmp_path / "out.h5", PANDA_GRIPPER)
    T, success = load_grasps(tmp_path / "out.h5")
    np.testing.assert_array_equal(success, grasps.score)
    assert success.dtype.kind == "i"
    back = T.copy()
    back[:, :3, 3] += 0.1034 * T[:, :3, 2]  # to the pads along the gripper's z
    np.testing.assert_allclose(back, grasps.X_OG, atol=1e-12)
    with h5py.File(tmp_path / "out.h5") as file:
        assert file["object/file"][()].decode() == "mug.obj"
        assert file["object/scale"][()] == 1.0
        assert file["gripper/type"][()].decode() == "panda"
        assert file["gripper/configuration"][0] == 0.04  # of each finger, open
    assert any("mug.obj" in note for note in notes)


def test_a_file_written_from_one_that_was_read_has_its_object_again(
    tmp_path: Path, random_grasps: Callable[..., GraspSet]
) -> None:
    path = dataset_file(tmp_path / "a.h5", random_grasps(3, 6).X_OG, [1, 0, 1])
    notes = acronym.write_acronym(
        acronym.read_acronym(path, PANDA_GRIPPER).grasps, tmp_path / "b.h5", PANDA_GRIPPER
    )
    assert notes == ("ACRONYM has no place for id.",)
    with h5py.File(path) as one, h5py.File(tmp_path / "b.h5") as other:
        for key in ("file", "scale", "mass", "com", "inertia", "volume"):
            np.testing.assert_array_equal(one[f"object/{key}"][()], other[f"object/{key}"][()])
        np.testing.assert_allclose(one["grasps/transforms"], other["grasps/transforms"], atol=1e-12)
        for name in ["object_in_gripper", *MOTIONS]:
            key = f"grasps/qualities/flex/{name}"
            np.testing.assert_array_equal(one[key], other[key])


def test_scores_that_are_no_success_are_kept_beside_flex(
    tmp_path: Path, random_grasps: Callable[..., GraspSet]
) -> None:
    grasps = random_grasps(5, 7).with_columns(epsilon=np.arange(5.0), remark=list("abcde"))
    notes = acronym.write_acronym(grasps, tmp_path / "a.h5", PANDA_GRIPPER)
    assert any("NaN for 5 grasps" in note for note in notes)
    assert any("remark" in note for note in notes)
    _, success = load_grasps(tmp_path / "a.h5")
    assert np.isnan(success).all()
    back = acronym.read_acronym(tmp_path / "a.h5", PANDA_GRIPPER).grasps
    np.testing.assert_array_equal(back.score, grasps.score)
    np.testing.assert_array_equal(back.width, grasps.width)
    np.testing.assert_array_equal(back.columns["epsilon"], np.arange(5.0))


def test_outcomes_of_trials_become_success(
    tmp_path: Path, random_grasps: Callable[..., GraspSet]
) -> None:
    grasps = random_grasps(3, 8).with_columns(outcome=["lifted", "slipped", "no_ik"])
    acronym.write_acronym(grasps, tmp_path / "a.h5", PANDA_GRIPPER)
    np.testing.assert_array_equal(load_grasps(tmp_path / "a.h5")[1], [1, 0, 0])
    untried = random_grasps(3, 8).with_columns(outcome=["lifted", "", "slipped"])
    notes = acronym.write_acronym(untried, tmp_path / "b.h5", PANDA_GRIPPER)
    assert any("NaN for 1 grasps" in note for note in notes)
    np.testing.assert_array_equal(load_grasps(tmp_path / "b.h5")[1], [1.0, np.nan, 0.0])


def test_qualities_of_other_simulators_keep_their_names(
    tmp_path: Path, random_grasps: Callable[..., GraspSet]
) -> None:
    T = random_grasps(2, 9).X_OG
    extra = {
        "grasps/qualities/physx/slip": np.array([0.1, 0.2]),
        "grasps/qualities/flex/width": np.array([3.0, 4.0]),  # whatever that is
    }
    path = dataset_file(tmp_path / "a.h5", T, [1, 1], **extra)
    grasps = acronym.read_acronym(path, PANDA_GRIPPER).grasps
    np.testing.assert_array_equal(grasps.columns["physx.slip"], [0.1, 0.2])
    np.testing.assert_array_equal(grasps.columns["flex.width"], [3.0, 4.0])
    assert np.isnan(grasps.width).all()
    acronym.write_acronym(grasps, tmp_path / "b.h5", PANDA_GRIPPER)
    with h5py.File(tmp_path / "b.h5") as file:
        np.testing.assert_array_equal(file["grasps/qualities/physx/slip"], [0.1, 0.2])


def test_several_objects_are_refused(
    tmp_path: Path, random_grasps: Callable[..., GraspSet]
) -> None:
    both = GraspSet.concatenate([random_grasps(2, 1), random_grasps(2, 2, object="bowl")])
    with pytest.raises(InvalidInputError, match=r"2 objects \(bowl, mug\).*choose one of them"):
        acronym.write_acronym(both, tmp_path / "a.h5", PANDA_GRIPPER)
    assert not list(tmp_path.iterdir())
    with pytest.raises(InvalidInputError, match="no grasps to write"):
        acronym.write_acronym(both.select([]), tmp_path / "a.h5", PANDA_GRIPPER)


FLEX = "grasps/qualities/flex/object_in_gripper"


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"grasps/transforms": None}, "grasps/transforms is missing"),
        ({"grasps/transforms": np.zeros((2, 3, 4))}, r"grasps/transforms has shape \(2, 3, 4\)"),
        ({"grasps/transforms": np.full((2, 4, 4), np.nan)}, r"grasps/transforms\[0\] has NaN"),
        ({"grasps/transforms": np.zeros((2, 4, 4))}, r"grasps/transforms\[0\] has a last row"),
        ({"grasps/transforms": [b"a", b"b"]}, r"grasps/transforms has shape \(2,\)"),
        ({"object/scale": 0.0}, "object/scale is 0; it must be above 0"),
        ({"object/scale": -1.0}, "object/scale is -1; it must be above 0"),
        ({"object/scale": np.nan}, "object/scale is nan; expected a finite number"),
        ({"object/scale": np.ones(2)}, r"object/scale has shape \(2,\); expected \(\) or \(1,\)"),
        ({"object/scale": "big"}, "object/scale has values of type text; expected numbers"),
        ({"object/scale": None}, "object/scale is missing"),
        ({"object/file": None}, "object/file is missing"),
        ({"object/file": 5}, "object/file has values of type int64; expected text"),
        ({FLEX: np.ones(3)}, r"object_in_gripper has shape \(3,\); expected \(2,\)"),
        ({FLEX: [b"y", b"n"]}, "object_in_gripper has values of type text; expected numbers"),
    ],
)
def test_malformed_files_say_where(tmp_path: Path, changed: dict[str, Any], said: str) -> None:
    path = dataset_file(tmp_path / "bad.h5", np.stack([DOWN, DOWN]), [1, 0], **changed)
    with pytest.raises(InvalidInputError, match=said) as caught:
        acronym.read_acronym(path, PANDA_GRIPPER)
    assert str(path) in str(caught.value)


def test_groups_in_the_place_of_datasets_and_the_other_way_round(tmp_path: Path) -> None:
    path = dataset_file(tmp_path / "a.h5", DOWN[None], [1], **{"object/scale": None})
    with h5py.File(path, "a") as file:
        file.create_group("object/scale")
    with pytest.raises(InvalidInputError, match="object/scale is a group"):
        acronym.read_acronym(path, PANDA_GRIPPER)
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file["grasps"] = np.zeros(3)
    assert not acronym.recognise_acronym(tmp_path / "b.h5")
    with pytest.raises(InvalidInputError, match="grasps/transforms is missing"):
        acronym.read_acronym(tmp_path / "b.h5", PANDA_GRIPPER)


def test_a_truncated_file_is_one_clear_error(tmp_path: Path) -> None:
    whole = dataset_file(tmp_path / "a.h5", np.repeat(DOWN[None], 500, 0), np.ones(500))
    content = whole.read_bytes()
    for share in (0.0, 0.01, 0.3, 0.9):
        cut = tmp_path / "cut.h5"
        cut.write_bytes(content[: int(share * len(content))])
        with pytest.raises(InvalidInputError, match=r"cut\.h5"):
            acronym.read_acronym(cut, PANDA_GRIPPER)


def test_another_hand_is_refused(tmp_path: Path) -> None:
    from dataclasses import replace

    path = dataset_file(tmp_path / "a.h5", DOWN[None], [1])
    with pytest.raises(InvalidInputError, match=r"gripper/type.*panda_hand.*wsg"):
        acronym.read_acronym(path, replace(PANDA_GRIPPER, name="wsg_50"))
    path = dataset_file(tmp_path / "b.h5", DOWN[None], [1], **{"gripper/type": "robotiq"})
    assert any(
        "the file names a hand 'robotiq', which was taken to be" in note
        for note in acronym.read_acronym(path, PANDA_GRIPPER).notes
    )
