"""From a grasp to a trajectory: what Drake says about every part of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from burg_drake.core import (
    InvalidInputError,
    Outcome,
    UnknownNameError,
    grasp_from_axes,
    rotation_angle,
    swap_fingers,
)
from burg_drake.motion import ArmReach, Plan, Planner, Reach, TimingSettings, plan
from burg_drake.scene import Scene, load_scene
from burg_drake.station import Station, instance_pose, load_station

DOWN = (0.0, 0.0, -1.0)
EVERY = 10
"""Samples between those that Drake is asked about."""


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene("tabletop_six")


@pytest.fixture(scope="module")
def station() -> Station:
    return load_station("panda_tabletop")


@pytest.fixture(scope="module")
def planner(scene: Scene, station: Station) -> Planner:
    return Planner(ArmReach(scene, station))


def from_above(scene: Scene, deep: float = 0.03) -> tuple[np.ndarray, float]:
    """`X_OG` (4, 4) of the box by its narrow side, 3 cm below its top, and the width."""
    low, high = scene.library.surface("box").bounds
    narrow = int(np.argmin((high - low)[:2]))
    place = [*((low + high) / 2.0)[:2], high[2] - deep]
    return grasp_from_axes(np.eye(3)[narrow], DOWN, place), float((high - low)[narrow])


@pytest.fixture(scope="module")
def planned(planner: Planner, scene: Scene) -> Plan:
    X_OG, width = from_above(scene)
    found = planner.plan("box", X_OG, width)
    assert isinstance(found, Plan)
    return found


def test_it_leads_from_home_to_the_grasp_and_up(
    planned: Plan, planner: Planner, scene: Scene, station: Station
) -> None:
    assert station.document.arm is not None and planned.origin is not None
    np.testing.assert_array_equal(planned.transfer.q[0], station.document.arm.home)
    X_WG = instance_pose(scene, station, "box") @ from_above(scene)[0]
    plant, names = planner.reach.diagram.plant, planned.origin.joints
    context = plant.CreateDefaultContext()
    body = plant.GetBodyByName(station.hand.body)
    for q, rise in ((planned.approach.q[-1], 0.0), (planned.lift.q[-1], 0.3)):
        for name, angle in zip(names, q, strict=True):
            plant.GetJointByName(name).set_angle(context, angle)
        X = body.EvalPoseInWorld(context).GetAsMatrix4() @ station.hand.X_HG.matrix()
        np.testing.assert_allclose(X[:3, 3], X_WG[:3, 3] + (0.0, 0.0, rise), atol=1e-6)
        ways = (X_WG, swap_fingers(X_WG))
        assert min(rotation_angle(X[:3, :3].T @ way[:3, :3]) for way in ways) < 1e-6


def test_drake_finds_its_samples_free(planned: Plan, planner: Planner) -> None:
    collision, arm = planner.reach._tree.edges.collision, planner.reach.kinematics
    for part in (planned.transfer, planned.approach):
        assert all(collision.is_free(q) for q in part.q[::EVERY])
    q = planned.lift.q[::EVERY]
    rises = arm.forward(q)[0][:, 2, 3] - arm.forward(q[:1])[0][0, 2, 3]
    for row, rise in zip(q, rises, strict=True):
        assert collision.is_free(row, carried="box", moved_W=(0.0, 0.0, max(0.0, float(rise))))


def test_it_keeps_the_limits(planned: Plan, planner: Planner) -> None:
    limits = planner.limits
    for part in (planned.transfer, planned.approach, planned.lift):
        v, a, j = (np.abs(np.diff(part.q, k, axis=0)).max(axis=0) / 1e-3**k for k in (1, 2, 3))
        assert (v <= limits.velocity * (1.0 + 1e-6)).all() and (
            a <= limits.acceleration * (1.0 + 1e-6)
        ).all()
        assert (j <= limits.jerk * (1.0 + 1e-6)).all()


def test_the_hand_has_time_to_close(planned: Plan, scene: Scene, station: Station) -> None:
    width = from_above(scene)[1]
    assert (planned.opening, planned.width) == (station.hand.opening[1], width)
    assert planned.close_time > (planned.opening - width) / 2.0 / station.hand.closing_speed


def test_another_plan_in_between_changes_nothing(
    planned: Plan, planner: Planner, scene: Scene
) -> None:
    planner.plan("box", *from_above(scene, 0.015))
    again = planner.plan("box", *from_above(scene))
    assert isinstance(again, Plan)
    np.testing.assert_array_equal(again.whole.q, planned.whole.q)


def test_a_grasp_out_of_reach_has_a_reason_and_no_plan(planner: Planner) -> None:
    found = planner.plan("box", grasp_from_axes((0.0, 1.0, 0.0), DOWN, (1.5, 0.0, 0.3)))
    assert isinstance(found, Reach) and found.outcome is Outcome.NO_IK


def test_what_is_no_grasp_of_the_scene(planner: Planner, scene: Scene) -> None:
    with pytest.raises(UnknownNameError, match=r"'bocks'.*box"):
        planner.plan("bocks", from_above(scene)[0])
    with pytest.raises(InvalidInputError, match=r"^X_OG "):
        planner.plan("box", np.zeros((4, 4)))


def test_corners_may_be_rounded_where_drake_agrees(planner: Planner, planned: Plan) -> None:
    """A detour of the transfer, which shortening takes out, and a slower one that keeps it."""
    found = planner.reach.check("box", planned.origin.X_WG, planned.width)  # type: ignore[union-attr]
    assert found.path is not None
    home, goal = found.path.transfer[[0, -1]]
    middle = home + np.array([0.3, -0.2, 0.0, 0.0, 0.0, 0.0, 0.0])
    detour = replace(found.path, transfer=np.array([home, middle, goal]))
    timed = planner.time("box", detour, planned.width)
    assert timed.transfer.duration == pytest.approx(planned.transfer.duration, abs=0.002)


def test_the_function_does_the_same(planned: Plan, scene: Scene, station: Station) -> None:
    X_OG, width = from_above(scene)
    slow = plan(scene, station, "box", X_OG, width=width, timing=TimingSettings(speed=0.5))
    assert isinstance(slow, Plan) and slow.origin is not None
    assert slow.origin.scene_content == scene.content and slow.origin.instance == "box"
    for name in ("transfer", "approach", "lift"):
        twice, once = getattr(slow, name), getattr(planned, name)
        np.testing.assert_array_equal(twice.q[[0, -1]], once.q[[0, -1]])
        assert twice.duration == pytest.approx(2.0 * once.duration, abs=0.003)
