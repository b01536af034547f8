"""The pose that an orientation belongs to, for shapes whose symmetries are known."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.core import Array
from burg_drake.objects import (
    PoseClasses,
    PotentialLandscape,
    SymmetrySearch,
    angle_between,
    stable_poses,
)

X, Y, Z = np.eye(3)


def classes(mesh: trimesh.Trimesh) -> PoseClasses:
    center, points = np.asarray(mesh.center_mass), np.asarray(mesh.vertices)
    poses = stable_poses(mesh, points, center)
    return PoseClasses(
        poses, PotentialLandscape(points, center), lambda: SymmetrySearch(mesh, center)
    )


def tilted(down: Array, towards: Array, angle: float) -> Array:
    return np.cos(angle) * down + np.sin(angle) * towards


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_box_upside_down_is_in_the_same_pose(sign: float) -> None:
    box = classes(trimesh.creation.box((0.1, 0.08, 0.06)))
    for k, axis in enumerate((Z, Y, X)):  # the largest face is the most probable
        found = box.find(tilted(sign * axis, np.roll(axis, 1), 0.04))
        assert found is not None
        assert found[0] == k
        assert found[1] == pytest.approx(0.04, abs=1e-6)


def test_a_box_on_its_edge_is_in_no_pose() -> None:
    box = classes(trimesh.creation.box((0.1, 0.08, 0.06)))
    assert box.find(tilted(Z, X, 0.5)) is None


def test_a_can_that_has_rolled_is_still_lying() -> None:
    can = classes(trimesh.creation.cylinder(0.03, 0.1, sections=48))
    for angle in (0.5, 2.0, 4.0):
        rolled = np.array([np.cos(angle), np.sin(angle), 0.0])
        found = can.find(tilted(rolled, Z, 0.02))
        assert found is not None
        assert found[0] == 0
        assert found[1] == pytest.approx(0.02, abs=2e-3)
    upright = can.find(tilted(Z, X, 0.01))
    assert upright is not None
    assert upright[0] == 1


def test_a_cone_on_its_tip_is_in_no_pose() -> None:
    cone = classes(trimesh.creation.cone(0.03, 0.08, sections=48))
    assert cone.find(Z) is None
    assert cone.find(-Z) is not None


def test_angles_of_unit_vectors() -> None:
    assert angle_between(X, Y) == pytest.approx(np.pi / 2)
    assert angle_between(X, tilted(X, Z, 1e-9)) == pytest.approx(1e-9)
