"""Poses of cameras as GraspNet-1Billion keeps them, and as people write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from burg_drake.core import InvalidInputError, make_pose
from burg_drake.formats import read_poses

RNG = np.random.default_rng(5)
CAMERAS = make_pose(Rotation.random(4, rng=RNG).as_matrix(), RNG.uniform(-1, 1, (4, 3)))
TABLE = make_pose(Rotation.random(rng=RNG).as_matrix(), (0.1, 0.2, 0.3))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    np.save(tmp_path / "camera_poses.npy", CAMERAS)
    np.save(tmp_path / "cam0_wrt_table.npy", TABLE.astype(np.float32))
    (tmp_path / "camera.yaml").write_text("translation: [1, 2, 3]\nrpy_deg: [180, 0, 0]\n")
    return tmp_path


def test_the_camera_on_the_table(folder: Path) -> None:
    files = [f"{folder}/cam0_wrt_table.npy", f"{folder}/camera_poses.npy:2"]
    np.testing.assert_allclose(read_poses(files), TABLE @ CAMERAS[2], atol=1e-6)
    np.testing.assert_allclose(read_poses(files[1:]), CAMERAS[2], atol=1e-15)


def test_yaml(folder: Path) -> None:
    expected = make_pose(np.diag([1.0, -1.0, -1.0]), (1.0, 2.0, 3.0))
    np.testing.assert_allclose(read_poses([f"{folder}/camera.yaml"]), expected, atol=1e-15)


def test_a_colon_may_be_part_of_a_name(folder: Path) -> None:
    np.save(folder / "run:3.npy", TABLE)
    np.testing.assert_allclose(read_poses([f"{folder}/run:3.npy"]), TABLE, atol=1e-15)
    (folder / "camera:3").write_text("translation: [1, 2, 3]\n")
    assert read_poses([f"{folder}/camera:3"])[:3, 3].tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("camera_poses.npy", "has 4 poses; say which one, such as .*camera_poses.npy:0"),
        ("camera_poses.npy:4", "has poses 0 to 3; there is no 4"),
        ("cam0_wrt_table.npy:1", "has poses 0 to 0; there is no 1"),
        ("camera.yaml:0", "holds one pose; leave out ':0'"),
        ("flat.npy", r"has shape \(16,\); expected \(4, 4\) or"),
        ("stacked.npy", r"has shape \(1, 2, 4, 4\); expected \(4, 4\) or"),
        ("skew.npy", r"pose 0\[0\] is not a rotation"),
        ("missing.npy", "cannot read"),
        ("missing.yaml", "cannot read"),
        ("bad.yaml", "unknown key 'position'"),
    ],
)
def test_malformed(reference: str, message: str, folder: Path) -> None:
    np.save(folder / "flat.npy", np.zeros(16))
    np.save(folder / "stacked.npy", np.zeros((1, 2, 4, 4)))
    np.save(folder / "skew.npy", make_pose(2 * np.eye(3)))
    (folder / "bad.yaml").write_text("position: [1, 2, 3]\n")
    with pytest.raises(InvalidInputError, match=message):
        read_poses([f"{folder}/{reference}"])
