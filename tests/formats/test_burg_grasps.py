"""Arrays as BURG-Toolkit's `GraspSet` has them, made by its own rules."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import Array, GraspSet, InvalidInputError, make_pose
from burg_drake.formats import BURG_TOOLKIT_FORMAT, PANDA_GRIPPER

FROM_ABOVE = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
"""x, the closing direction, along y of the world; z up, where the hand comes from."""


def between_contacts(one: Array, other: Array, from_where: Array) -> Array:
    """(4, 4) pose by the rule of `construct_grasp_set`: x towards the other contact, z to the hand,
    origin in the middle."""
    x = (other - one) / np.linalg.norm(other - one)
    y = np.cross(from_where, x)
    y /= np.linalg.norm(y)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([x, y, np.cross(x, y)])
    pose[:3, 3] = (one + other) / 2
    return pose


def test_a_cube_from_above(tmp_path: Path, assert_grips_the_cube: Callable[[Array], None]) -> None:
    pose = between_contacts(
        np.array([0.0, -0.02, 0.0]), np.array([0.0, 0.02, 0.0]), np.array([0.0, 0.0, 1.0])
    )
    np.testing.assert_allclose(pose[:3, :3], FROM_ABOVE, atol=1e-15)
    np.save(tmp_path / "grasps.npy", np.array([pose], dtype=np.float32))
    imported = BURG_TOOLKIT_FORMAT.read(tmp_path / "grasps.npy", PANDA_GRIPPER)
    assert (imported.frame, imported.notes) == ("world", ())
    assert_grips_the_cube(imported.grasps.X_OG[0])
    assert np.isnan([imported.grasps.width[0], imported.grasps.score[0]]).all()


def test_their_franka_hand_grips_where_ours_does(tmp_path: Path) -> None:
    # jogramop-framework: grasps @ tf_grasp2ee is the pose of the hand's frame but for its origin
    grasp2ee = np.array([[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1.0]])
    pose = between_contacts(
        np.array([0.1, -0.02, 0.3]), np.array([0.2, 0.02, 0.4]), np.array([0.3, 0.1, 1.0])
    )
    np.save(tmp_path / "grasps.npy", pose[None])
    X_WG = BURG_TOOLKIT_FORMAT.read(tmp_path / "grasps.npy", PANDA_GRIPPER).grasps.X_OG[0]
    X_WH = X_WG @ np.linalg.inv(PANDA_GRIPPER.X_HG)
    np.testing.assert_allclose(X_WH[:3, :3], (pose @ grasp2ee)[:3, :3], atol=1e-12)


def test_rows_of_the_internal_array(tmp_path: Path) -> None:
    rows = np.zeros((2, 14), dtype=np.float32)  # Grasp.ARRAY_LEN
    rows[:, 0:3] = [[0.0, 0.0, 0.0], [0.1, 0.2, 0.3]]
    rows[:, 3:12] = np.reshape(FROM_ABOVE, 9)
    np.save(tmp_path / "unset.npy", rows)
    unset = BURG_TOOLKIT_FORMAT.read(tmp_path / "unset.npy", PANDA_GRIPPER).grasps
    assert np.isnan(unset.width).all() and np.isnan(unset.score).all()
    rows[:, 12], rows[:, 13] = [0.0, 1.0], [0.04, 0.05]
    np.save(tmp_path / "set.npy", rows)
    assert BURG_TOOLKIT_FORMAT.recognises(tmp_path / "set.npy")
    grasps = BURG_TOOLKIT_FORMAT.read(tmp_path / "set.npy", PANDA_GRIPPER).grasps
    assert grasps.score.tolist() == [0.0, 1.0]
    np.testing.assert_allclose(grasps.width, [0.04, 0.05], rtol=1e-7)
    np.testing.assert_allclose(grasps.X_OG[1, :3, 3], [0.1, 0.2, 0.3], rtol=1e-7)
    np.testing.assert_array_equal(grasps.X_OG[:, :3, 2], [[0, 0, -1], [0, 0, -1]])
    np.testing.assert_array_equal(grasps.X_OG[:, :3, 0], [[0, 1, 0], [0, 1, 0]])  # closes along y


@pytest.mark.parametrize("seed", range(3))
def test_round_trip(seed: int, random_grasps: Callable[..., GraspSet], tmp_path: Path) -> None:
    grasps = random_grasps(100, seed)
    notes = BURG_TOOLKIT_FORMAT.write(grasps, tmp_path / "a.npy", PANDA_GRIPPER)
    assert notes == ("BURG-Toolkit has no place for width, id, object, score.",)
    assert BURG_TOOLKIT_FORMAT.recognises(tmp_path / "a.npy")
    written = np.load(tmp_path / "a.npy")
    np.testing.assert_allclose(written[:, :3, 0], grasps.X_OG[:, :3, 0], atol=1e-15)
    np.testing.assert_allclose(written[:, :3, 2], -grasps.X_OG[:, :3, 2], atol=1e-15)
    np.testing.assert_allclose(written[:, :3, 3], grasps.X_OG[:, :3, 3], atol=1e-15)
    back = BURG_TOOLKIT_FORMAT.read(tmp_path / "a.npy", PANDA_GRIPPER).grasps
    np.testing.assert_allclose(back.X_OG, grasps.X_OG, atol=1e-14)


def test_no_grasps(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.zeros((0, 4, 4)))
    assert BURG_TOOLKIT_FORMAT.recognises(tmp_path / "a.npy")
    assert len(BURG_TOOLKIT_FORMAT.read(tmp_path / "a.npy", PANDA_GRIPPER).grasps) == 0


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.zeros((3, 13)), r"has shape \(3, 13\); grasps of BURG-Toolkit have \(n, 4, 4\) or"),
        (np.eye(4), r"has shape \(4, 4\); grasps of BURG-Toolkit have"),
        (np.zeros((1, 4, 4)), r"\[0\] has a last row that is not 0 0 0 1"),
        (np.stack([np.eye(4), make_pose(2 * np.eye(3))]), r"\[1\] is not a rotation"),
        (make_pose(p_AB=[[np.nan, 0, 0]]), r"\[0\] has NaN or infinite numbers"),
        (np.zeros((1, 14)), r"columns 0 to 11\[0\] is not a rotation"),
    ],
)
def test_malformed(values: Array, message: str, tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", values)
    with pytest.raises(InvalidInputError, match=message):
        BURG_TOOLKIT_FORMAT.read(tmp_path / "a.npy", PANDA_GRIPPER)
