"""Hands as the formats of other projects know them, from documents and models."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.formats import PANDA_GRIPPER
from burg_drake.station import gripper_of, locate_hand


def test_the_panda_is_the_built_in_hand() -> None:
    built_in = gripper_of(*locate_hand("panda_hand"))
    assert (built_in.name, built_in.body) == (PANDA_GRIPPER.name, PANDA_GRIPPER.body)
    np.testing.assert_allclose(built_in.X_HG, PANDA_GRIPPER.X_HG, atol=1e-12)
    assert built_in.tip == pytest.approx(PANDA_GRIPPER.tip, abs=1e-9)
    assert (built_in.opening, built_in.joints) == (PANDA_GRIPPER.opening, PANDA_GRIPPER.joints)


def test_the_wsg_closes_along_x_of_its_body_with_one_finger_running_backwards() -> None:
    wsg = gripper_of(*locate_hand("wsg_50"))
    np.testing.assert_allclose(wsg.X_HG[:3, :3], np.eye(3), atol=1e-12)
    assert wsg.tip == pytest.approx(0.01, abs=1e-6)  # pads of 20 mm about G
    positions = wsg.positions([0.0, 0.11])
    np.testing.assert_allclose(positions["wsg_left_joint"], [0.0, 0.055])
    np.testing.assert_allclose(positions["wsg_right_joint"], [0.0, -0.055])
    np.testing.assert_allclose(wsg.width(positions), [0.0, 0.11])
