"""The search for chains: where they lead, what refusing them does, and why there is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from burg_drake.core import Array, Outcome, grasp_from_axes, swap_fingers
from burg_drake.motion import (
    ArmKinematics,
    ArmProximity,
    ClosedFormLineSearch,
    HandPath,
    LineSearchBatch,
    PandaIk,
    ReachSettings,
    panda_forward,
)
from burg_drake.scene import load_scene
from burg_drake.station import GraspMotion, build_station_diagram, load_station

DOWN = (0.0, 0.0, -1.0)
STATION = load_station("panda_tabletop")
ABOVE = grasp_from_axes((0.0, 1.0, 0.0), DOWN, (0.5, 0.1, 0.25))
HIGH = grasp_from_axes((0.0, 1.0, 0.0), DOWN, (0.45, 0.0, 0.62))
FAR = grasp_from_axes((0.0, 1.0, 0.0), DOWN, (1.1, 0.0, 0.2))


@pytest.fixture(scope="module")
def search() -> ClosedFormLineSearch:
    diagram = build_station_diagram(
        load_scene("tabletop_six"), STATION, robot="arm", weld_objects=True
    )
    arm = ArmKinematics.of(diagram)
    ik = PandaIk.of(arm)
    assert ik is not None and STATION.document.arm is not None
    path = HandPath.of(STATION.hand.X_HG.matrix(), np.eye(3), GraspMotion())
    home = np.array(STATION.document.arm.home)
    settings = ReachSettings()
    return ClosedFormLineSearch(arm, ik.within(0.01), path, ArmProximity(diagram), home, settings)


def begin(search: ClosedFormLineSearch, *grasps: Array) -> LineSearchBatch:
    X_AG = np.array([[X, swap_fingers(X)] for X in grasps])
    return search.begin(X_AG, np.full((len(grasps), 2), 1e-3))


def test_a_chain_leads_over_the_grasp_to_the_top_of_the_lift(search: ClosedFormLineSearch) -> None:
    (chain,) = begin(search, ABOVE).propose([0])
    assert chain is not None
    X = panda_forward(chain.q) @ search.ik.X_FH @ STATION.hand.X_HG.matrix()
    goal = (ABOVE, swap_fingers(ABOVE))[chain.flip]
    np.testing.assert_allclose(X[chain.at_grasp], goal, atol=1e-9)
    np.testing.assert_allclose(X[0, :3, 3], goal[:3, 3] - 0.1 * goal[:3, 2], atol=1e-9)
    np.testing.assert_allclose(X[-1, :3, 3], goal[:3, 3] + (0.0, 0.0, 0.3), atol=1e-9)
    assert (chain.moved_W[: chain.at_grasp + 1] == 0.0).all()
    np.testing.assert_array_equal(chain.moved_W[-1], (0.0, 0.0, 0.3))
    np.testing.assert_allclose(
        np.diff(X[:, 2, 3])[chain.at_grasp :], np.diff(chain.moved_W[10:, 2])
    )
    np.testing.assert_array_less(np.abs(np.diff(chain.q, axis=0)).max(), 0.35)


def test_a_refused_chain_does_not_come_back_and_at_last_there_is_none(
    search: ClosedFormLineSearch,
) -> None:
    batch = begin(search, ABOVE)
    starts: list[Array] = []
    for _ in range(1000):
        (chain,) = batch.propose([0])
        if chain is None:
            break
        assert not starts or np.abs(chain.q[0] - starts[-1]).max() > 1e-9
        starts.append(chain.q[0])
        batch.refuse(0, chain, None)
    else:
        pytest.fail("the search does not end")
    assert len(starts) > 5


def test_refusing_one_grasp_leaves_the_others_alone(search: ClosedFormLineSearch) -> None:
    batch = begin(search, ABOVE, ABOVE)
    first, second = batch.propose([0, 1])
    assert first is not None and second is not None
    batch.refuse(0, first, 20)
    other, same = batch.propose([0, 1])
    assert other is not None and same is not None
    np.testing.assert_array_equal(same.q, second.q)
    assert other.q.shape != first.q.shape or not np.array_equal(other.q, first.q)


def test_beyond_the_arm_there_is_no_ik(search: ClosedFormLineSearch) -> None:
    batch = begin(search, FAR, ABOVE)
    assert batch.propose([0, 1])[0] is None
    assert batch.failure(0).outcome is Outcome.NO_IK


@pytest.mark.thorough
def test_beyond_a_joint_limit_the_excess_is_no_larger_than_that_of_a_known_posture(
    search: ClosedFormLineSearch,
) -> None:
    """Postures with a joint beyond its limit; where no other posture is within, that is said."""
    still = replace(search.hand_path, standoff=0.0, lift=0.0)
    ends = ClosedFormLineSearch(
        search.arm, search.ik, still, search.proximity, search.home, search.settings
    )
    rng = np.random.default_rng(5)
    q = rng.uniform(search.ik.lower, search.ik.upper, (400, 7))
    excess = rng.uniform(0.1, 0.5, 400)
    q[:, 5] = search.ik.lower[5] - excess  # the wrist is folded too far
    X_AG = panda_forward(q) @ search.ik.X_FH @ STATION.hand.X_HG.matrix()
    batch = begin(ends, *X_AG)
    batch.propose(range(400))
    failures = [batch.failure(k) for k in range(400)]
    beyond = [k for k in range(400) if failures[k].outcome is Outcome.JOINT_LIMIT]
    assert len(beyond) > 5
    for k in beyond:
        assert 0.0 < failures[k].excess < excess[k] + 0.07  # the redundant joint has a grid


@pytest.mark.parametrize("joint", [3, 5])
def test_the_excess_counts_whole_turns_of_every_joint(
    search: ClosedFormLineSearch, joint: int
) -> None:
    """Joints 4 and 6 have ranges that are not symmetric: just beyond a limit they may be half a
    turn away from 0."""
    still = replace(search.hand_path, standoff=0.0, lift=0.0)
    rest = search.proximity, search.home, search.settings
    ends = ClosedFormLineSearch(search.arm, search.ik, still, *rest)
    rng = np.random.default_rng(7)
    q = rng.uniform(search.ik.lower, search.ik.upper, (60, 7))
    excess = rng.uniform(0.02, 0.1, 60)
    q[:, joint] = search.ik.lower[joint] - excess
    X_AG = panda_forward(q) @ search.ik.X_FH @ STATION.hand.X_HG.matrix()
    batch = begin(ends, *X_AG)
    batch.propose(range(60))
    failures = [batch.failure(k) for k in range(60)]
    beyond = [k for k in range(60) if failures[k].outcome is Outcome.JOINT_LIMIT]
    assert len(beyond) >= 2
    assert all(0.0 < failures[k].excess < excess[k] + 1e-3 for k in beyond)


def test_where_the_lift_leads_out_of_reach_the_line_fails(search: ClosedFormLineSearch) -> None:
    batch = begin(search, HIGH)
    assert batch.propose([0]) == [None]
    failure = batch.failure(0)
    assert failure.outcome is Outcome.LIFT_LINE and np.isnan(failure.excess)
    assert failure.reason == "part of the lift is out of the arm's reach"


def test_a_chain_does_not_depend_on_the_batch(search: ClosedFormLineSearch) -> None:
    other = grasp_from_axes((1.0, 0.3, 0.0), (0.3, -0.2, -1.0), (0.42, -0.2, 0.3))
    together = begin(search, FAR, other, ABOVE).propose([0, 1, 2])[1]
    (alone,) = begin(search, other).propose([0])
    assert together is not None and alone is not None
    np.testing.assert_array_equal(together.q, alone.q)
    np.testing.assert_array_equal(together.lower, alone.lower)


def test_a_way_that_is_closed_is_not_proposed(search: ClosedFormLineSearch) -> None:
    batch = begin(search, ABOVE, ABOVE)
    first, second = batch.propose([0, 1])
    assert first is not None and second is not None
    batch.close(0, first.flip)
    other, same = batch.propose([0, 1])
    assert other is not None and same is not None
    assert other.flip != first.flip and same.flip == second.flip
    batch.close(0, other.flip)
    assert batch.propose([0]) == [None]
