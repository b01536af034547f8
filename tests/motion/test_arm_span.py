"""The longest reach of an arm: against closed form and random configurations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from burg_drake.core import Pose, transform_points
from burg_drake.motion import (
    ArmKinematics,
    ArmSpan,
    empty_scene,
    unreachable_board,
    unreachable_objects,
)
from burg_drake.scene import load_scene
from burg_drake.station import Station, build_station_diagram, load_station


def kinematics(station: Station) -> ArmKinematics:
    return ArmKinematics.of(build_station_diagram(empty_scene(), station, robot="arm"))


def test_of_the_panda_is_what_its_links_add_up_to() -> None:
    """Shoulder to elbow, elbow to wrist, wrist to between the pads: lengths of Franka's table."""
    station = load_station("panda_offset")
    span = ArmSpan.of(kinematics(station), station)
    longest = np.hypot(0.316, 0.0825) + np.hypot(0.384, 0.0825) + np.hypot(0.088, 0.107 + 0.1034)
    assert span.radius == pytest.approx(longest, abs=1e-5)
    assert span.p_WJ == pytest.approx([-0.16, 0.25, 0.08 + 0.333], abs=1e-5)


@pytest.mark.parametrize("name", ["panda_wsg", "ur5e_tabletop"])
def test_no_configuration_leaves_the_span(name: str) -> None:
    station = load_station(name)
    arm = kinematics(station)
    span = ArmSpan.of(arm, station)
    q = np.random.default_rng(1).uniform(arm.lower, arm.upper, (20_000, len(arm.lower)))
    assert station.document.arm is not None
    p_AG = (arm.forward(q)[0] @ station.hand.X_HG.matrix())[:, :3, 3]
    p_WG = transform_points(station.document.arm.X_WA.matrix(), p_AG)
    distance = np.linalg.norm(p_WG - span.p_WJ, axis=1)
    assert distance.max() < span.radius
    assert distance.max() > 0.9 * span.radius


def moved(station: Station, x: float) -> Station:
    assert station.document.arm is not None
    arm = replace(station.document.arm, X_WA=Pose((x, 0.0, 0.0)))
    return replace(station, document=replace(station.document, arm=arm))


def test_a_board_out_of_reach() -> None:
    """The sheet begins 0.24 m from W; the shoulder is 0.333 m above the table."""
    station, board = load_station("panda_tabletop"), empty_scene().board
    reach = 0.94742
    edge = np.sqrt(reach**2 - 0.333**2)
    near, far = (moved(station, 0.24 - edge + change) for change in (0.002, -0.002))
    assert unreachable_board(ArmSpan.of(kinematics(near), near), near, board) == ""
    text = unreachable_board(ArmSpan.of(kinematics(far), far), far, board)
    assert text == (
        f"{station.path}: no part of the board is within reach: its nearest point is 0.95 m from"
        " the arm's shoulder, and the arm reaches 0.95 m at most; change X_WS or arm.X_WA"
    )


def test_objects_out_of_reach() -> None:
    """From 70 cm further back the bowl, in the last row, is out of reach."""
    scene, station = load_scene("tabletop_six"), moved(load_station("panda_tabletop"), -0.7)
    found = unreachable_objects(ArmSpan.of(kinematics(station), station), scene, station)
    assert set(found) >= {"bowl", "banana"}
    assert found["bowl"].startswith("'bowl' is out of reach: it is 1.")
    assert found["bowl"].endswith(" m from the arm's shoulder, and the arm reaches 0.95 m at most")
    here = load_station("panda_tabletop")
    assert unreachable_objects(ArmSpan.of(kinematics(here), here), scene, here) == {}
