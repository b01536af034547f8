"""The whole reach check of an arm without a closed form of its own: motions that Drake's checker
finds free, and the same verdicts by a routine that somebody brought along."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import ur_ik

from burg_drake.core import Outcome, inverse, make_pose, rot_z
from burg_drake.motion import ArmCollision, ArmReach, Reach
from burg_drake.scene import Scene, load_scene
from burg_drake.station import Station, build_station_diagram, instance_pose, load_station

DOWN = np.diag([1.0, -1.0, -1.0])


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Bottle and box, which stand beside each other."""
    whole = load_scene("tabletop_six")
    two = tuple(i for i in whole.document.instances if i.object in ("bottle", "box"))
    return replace(whole, document=replace(whole.document, instances=two))


@pytest.fixture(scope="module")
def station() -> Station:
    return load_station("ur5e_tabletop")


@pytest.fixture(scope="module")
def grasps(scene: Scene, station: Station) -> tuple[list[str], np.ndarray]:
    """Over the tops of bottle and box, turned two ways; one of them out of reach."""
    names, poses = [], []
    for name, height in (("bottle", 0.17), ("box", 0.15)):
        p = instance_pose(scene, station, name)[:3, 3]
        for turn in np.arange(2) * np.pi / 2:
            names.append(name)
            poses.append(make_pose(rot_z(turn) @ DOWN, (*p[:2], height)))
    names.append("box")
    poses.append(make_pose(DOWN, (1.3, 0.0, 0.3)))
    return names, np.array(poses)


@pytest.fixture(scope="module")
def verdicts(scene: Scene, station: Station, grasps: tuple[list[str], np.ndarray]) -> list[Reach]:
    return ArmReach(scene, station).check_all(*grasps)


@pytest.mark.thorough
def test_motions_are_free_and_whole(
    scene: Scene, station: Station, grasps: tuple[list[str], np.ndarray], verdicts: list[Reach]
) -> None:
    diagram = build_station_diagram(scene, station, weld_objects=True)
    collision = ArmCollision(diagram)
    arm = station.document.arm
    assert arm is not None
    X_FG = arm.X_FH.matrix() @ station.hand.X_HG.matrix()
    yes = [(n, r.path) for n, r in zip(grasps[0], verdicts, strict=True) if r.path]
    assert len(yes) >= 2
    for name, arm_path in yes:
        np.testing.assert_allclose(arm_path.transfer[0], arm.home, atol=0)
        np.testing.assert_array_equal(arm_path.transfer[-1], arm_path.approach[0])
        np.testing.assert_array_equal(arm_path.approach[-1], arm_path.lift[0])
        for q in np.concatenate([between(arm_path.transfer), arm_path.approach]):
            assert collision.is_free(q)
        rise = flange(arm_path.lift, station)[:, 2, 3] - flange(arm_path.lift[:1], station)[0, 2, 3]
        assert rise[-1] == pytest.approx(0.30, abs=1e-5)
        for q, height in zip(arm_path.lift, rise, strict=True):
            assert collision.is_free(q, carried=name, moved_W=(0.0, 0.0, max(0.0, float(height))))
        X_WG = flange(arm_path.approach[-1:], station)[0] @ X_FG
        np.testing.assert_allclose(X_WG, arm_path.X_WG, atol=1e-5)


def between(q: np.ndarray) -> np.ndarray:
    """A polyline in steps of about 0.05 rad."""
    parts = []
    for a, b in pairwise(q):
        count = int(np.abs(b - a).max() / 0.05) + 2
        parts.append(np.linspace(a, b, count))
    return np.concatenate(parts)


def flange(q: np.ndarray, station: Station) -> np.ndarray:
    """Poses of the flange in the world (N, 4, 4), by the DH table."""
    arm = station.document.arm
    assert arm is not None
    return np.array([arm.X_WA.matrix() @ ur_ik.forward(one) for one in q])


@pytest.mark.thorough
def test_out_of_reach_is_named(verdicts: list[Reach]) -> None:
    assert verdicts[-1].outcome is Outcome.NO_IK and verdicts[-1].path is None


def test_a_routine_of_ones_own_gives_the_same_verdicts(
    scene: Scene, station: Station, grasps: tuple[list[str], np.ndarray], verdicts: list[Reach]
) -> None:
    arm = station.document.arm
    assert arm is not None
    X_HF = inverse(arm.X_FH.matrix())
    own = ArmReach(scene, station, ik=lambda X_AH: [ur_ik.solve(X @ X_HF) for X in X_AH])
    assert [r.outcome for r in own.check_all(*grasps)] == [r.outcome for r in verdicts]
