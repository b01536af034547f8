"""Where arm configurations are looked for: closed form and numeric search on the same terms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.planning import RobotDiagramBuilder

from burg_drake.core.frames import Array, make_pose, pregrasp, swap_fingers
from burg_drake.core.resources import resolve
from burg_drake.motion.ik import ArmKinematics
from burg_drake.motion.postures import (
    ClosedFormPostures,
    NumericPostures,
    Posture,
    PostureSearch,
    posture_search,
)
from burg_drake.motion.reach_settings import ReachSettings

HOME = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])
SETTINGS = ReachSettings(redundant=(32, 96), starts=(32, 64))


@pytest.fixture(scope="module")
def arm() -> ArmKinematics:
    """The Panda with its flange for a hand."""
    builder = RobotDiagramBuilder()
    builder.parser().AddModels(str(resolve("package://burg_drake/models/panda/panda_arm.sdf")))
    plant: MultibodyPlant = builder.plant()
    base, flange = plant.GetFrameByName("panda_link0"), plant.GetFrameByName("panda_link8")
    plant.WeldFrames(plant.world_frame(), base)
    plant.Finalize()
    joints = [plant.GetJointByName(f"panda_joint{i}") for i in range(1, 8)]
    return ArmKinematics.from_plant(plant, joints, base, flange)


@pytest.fixture(scope="module")
def goals() -> list[tuple[Array, Array]]:
    """Flange poses pointing down and sideways over a table, both finger ways, and 10 cm before."""
    rng = np.random.default_rng(4)
    found = []
    for _ in range(12):
        tilt, turn = rng.uniform(np.pi * 0.6, np.pi), rng.uniform(-np.pi, np.pi)
        c, s, ct, st = np.cos(turn), np.sin(turn), np.cos(tilt), np.sin(tilt)
        R = np.array([[c, -s * ct, s * st], [s, c * ct, -c * st], [0.0, st, ct]])
        X = make_pose(R, rng.uniform((0.35, -0.3, 0.15), (0.65, 0.3, 0.4)))
        ways = np.array([X, swap_fingers(X)])
        found.append((ways, pregrasp(ways, 0.1)))
    return found


def all_rounds(search: PostureSearch, goal: tuple[Array, Array]) -> list[list[Posture]]:
    return list(search.rounds(*goal))


def test_the_panda_has_a_closed_form_and_other_arms_have_not(arm: ArmKinematics) -> None:
    assert isinstance(posture_search(arm, HOME, SETTINGS), ClosedFormPostures)
    numeric = replace(SETTINGS, closed_form=False)
    assert isinstance(posture_search(arm, HOME, numeric), NumericPostures)
    axes = arm.p_AJ.copy()
    axes[5:, 0] += 0.02
    assert isinstance(posture_search(replace(arm, p_AJ=axes), HOME, SETTINGS), NumericPostures)


@pytest.mark.parametrize("closed_form", [True, False])
def test_postures_are_at_grasp_and_pregrasp_within_limits_and_travel(
    arm: ArmKinematics, goals: list[tuple[Array, Array]], closed_form: bool
) -> None:
    settings = replace(SETTINGS, closed_form=closed_form, joint_travel=0.7)
    search = posture_search(arm, HOME, settings)
    count = 0
    for goal in goals:
        for posture in (p for found in all_rounds(search, goal) for p in found):
            for q, X_AH in zip((posture.q, posture.q_before), goal, strict=True):
                at, _ = arm.forward(q[None])
                np.testing.assert_allclose(at[0], X_AH[posture.way], atol=1e-5)
                assert (arm.lower + 0.01 - 1e-12 <= q).all()
                assert (q <= arm.upper - 0.01 + 1e-12).all()
            assert np.abs(posture.q - posture.q_before).max() <= 0.7
            count += 1
    assert count > 100


def test_rounds_begin_near_home_and_do_not_repeat_each_other(
    arm: ArmKinematics, goals: list[tuple[Array, Array]]
) -> None:
    search = posture_search(arm, HOME, SETTINGS)
    for goal in goals:
        rounds = all_rounds(search, goal)
        assert len(rounds) == 2
        for found in rounds:
            distance = [np.abs(posture.q_before - HOME).max() for posture in found]
            assert distance == sorted(distance)
        first, second = ({posture.q[6] for posture in found} for found in rounds)
        assert not first & second


def test_a_fine_sweep_passes_by_whatever_the_numeric_search_finds(
    arm: ArmKinematics, goals: list[tuple[Array, Array]]
) -> None:
    closed = posture_search(arm, HOME, replace(SETTINGS, redundant=(960,)))
    numeric = posture_search(arm, HOME, replace(SETTINGS, closed_form=False))
    distance = []
    for goal in goals:
        (swept,) = all_rounds(closed, goal)
        for posture in (p for found in all_rounds(numeric, goal) for p in found):
            same = [np.abs(p.q - posture.q).max() for p in swept if p.way == posture.way]
            distance.append(min(same))
    assert len(distance) > 100 and max(distance) < 0.15
