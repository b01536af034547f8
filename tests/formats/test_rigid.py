"""Poses as they come: single precision is made orthonormal, anything worse is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from burg_drake.core import Array, InvalidInputError, make_pose
from burg_drake.formats import nearest_rigid


@pytest.fixture
def poses() -> Array:
    rng = np.random.default_rng(5)
    return make_pose(Rotation.random(50, rng=rng).as_matrix(), rng.normal(size=(50, 3)))


def off_orthonormal(X: Array) -> float:
    R = X[:, :3, :3]
    return float(np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max())


def test_single_precision_becomes_orthonormal_without_a_note(poses: Array) -> None:
    single = poses.astype(np.float32)
    assert off_orthonormal(single.astype(float)) > 1e-8
    found, notes = nearest_rigid(single, "file: key")
    assert off_orthonormal(found) < 1e-14
    np.testing.assert_allclose(found, poses, atol=1e-6)
    assert notes == ()


def test_four_decimals_become_the_nearest_rotation_with_a_note(poses: Array) -> None:
    rounded = poses.round(4)
    found, notes = nearest_rigid(rounded, "file: key")
    assert off_orthonormal(found) < 1e-14
    # no rotation close to the given matrix is nearer than the one found (Frobenius norm)
    best = np.linalg.norm(found[:, :3, :3] - rounded[:, :3, :3], axis=(1, 2))
    rng = np.random.default_rng(6)
    for _ in range(20):
        turned = found[:, :3, :3] @ Rotation.from_rotvec(1e-5 * rng.normal(size=3)).as_matrix()
        other = np.linalg.norm(turned - rounded[:, :3, :3], axis=(1, 2))
        assert (other >= best - 1e-12).all()
    assert len(notes) == 1 and notes[0].startswith("file: key")


@pytest.mark.parametrize(
    ("corrupt", "said"),
    [
        (lambda X: X.__setitem__((3, 0, 0), np.nan), r"file: key\[3\] has NaN or infinite"),
        (lambda X: X.__setitem__((3, 2, 3), np.inf), r"file: key\[3\] has NaN or infinite"),
        (lambda X: X.__setitem__((3, slice(0, 3), 0), 0.0), r"file: key\[3\] is not a rotation"),
        (lambda X: X.__setitem__(3, X[3] * [[2.0], [2.0], [2.0], [1.0]]), r"\[3\] is not a"),
        (lambda X: X.__setitem__((3, 3, 0), 0.5), r"file: key\[3\] has a last row that is not"),
        (
            lambda X: X.__setitem__((3, slice(0, 3), 0), -X[3, :3, 0]),
            r"\[3\] is a reflection",
        ),
    ],
)
def test_what_is_not_rigid_is_refused(poses: Array, corrupt, said: str) -> None:  # type: ignore[no-untyped-def]
    corrupt(poses)
    with pytest.raises(InvalidInputError, match=said):
        nearest_rigid(poses, "file: key")


@pytest.mark.parametrize("shape", [(50, 4), (50, 3, 4), (4, 4), (2, 25, 4, 4)])
def test_wrong_shapes_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(InvalidInputError, match=r"has shape .* expected \(N, 4, 4\)"):
        nearest_rigid(np.zeros(shape), "file: key")


def test_ragged_lists_and_texts_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="file: key must hold"):
        nearest_rigid([[[1.0, 2.0], [3.0]]], "file: key")
    with pytest.raises(InvalidInputError, match="file: key must hold"):
        nearest_rigid([[["a"] * 4] * 4], "file: key")


def test_none_are_fine() -> None:
    found, notes = nearest_rigid(np.empty((0, 4, 4)), "file: key")
    assert found.shape == (0, 4, 4) and notes == ()
