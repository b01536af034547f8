"""The Panda that formats know: its tips, widths and joints, its base."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.core import resolve_reference
from burg_drake.formats import PANDA_GRIPPER


def test_the_panda_s_tips_are_where_its_finger_mesh_ends() -> None:
    finger = trimesh.load(resolve_reference("package://burg_drake/models/panda/meshes/finger.obj"))
    tip_in_hand = 0.0584 + finger.bounds[1, 2]  # joint origin of franka_ros
    assert PANDA_GRIPPER.X_HG[2, 3] + PANDA_GRIPPER.tip == pytest.approx(tip_in_hand, abs=1e-3)


def test_width_of_the_panda_is_the_sum_of_its_finger_joints() -> None:
    assert PANDA_GRIPPER.width({"panda_finger_joint1": 0.01}) == pytest.approx(0.02)
    both = {"panda_finger_joint1": [0.01, 0.04], "panda_finger_joint2": [0.01, 0.04]}
    np.testing.assert_allclose(PANDA_GRIPPER.width(both), [0.02, 0.08])


def test_base_has_the_origin_of_the_hand_and_the_axes_of_g() -> None:
    np.testing.assert_allclose(PANDA_GRIPPER.X_GB[:3, :3], np.eye(3))
    np.testing.assert_allclose(PANDA_GRIPPER.X_GB[:3, 3], [0.0, 0.0, -0.1034], atol=1e-15)
    np.testing.assert_allclose(PANDA_GRIPPER.X_GH @ PANDA_GRIPPER.X_HG, np.eye(4), atol=1e-15)
