"""Retreats, lifts along other directions, and lifts as high as there is room: by arithmetic on a
gantry, and on a Panda under a table against Drake in a diagram of its own."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gantry import UPPER, box, gantry_diagram

from burg_drake.core import (
    Array,
    Outcome,
    Pose,
    grasp_from_axes,
    make_pose,
    rng_from,
    rot_z,
    swap_fingers,
)
from burg_drake.grasping import AntipodalSettings, HandClearance, sample_antipodal
from burg_drake.motion import ArmReach, Planner, Reach, ReachSettings, load_plan
from burg_drake.scene import Scene, load_scene
from burg_drake.station import GraspMotion, Obstacle, Station, build_station_diagram, load_station

DOWN = (0.0, 0.0, -1.0)
Z, TCP = 0.3, 0.1034
HIGH = Z + TCP + 0.125
"""Top of the gantry's block at the grasp, which reaches 50 mm to the front, the hand 32 mm [m]."""
X_WG = grasp_from_axes((0.0, 1.0, 0.0), DOWN, (0.5, 0.0, Z))
BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


def gantry(folder: Path, motion: GraspMotion, **background: Obstacle) -> ArmReach:
    diagram = gantry_diagram(folder, **background)
    return ArmReach(diagram.scene, diagram.station, settings=ReachSettings(motion=motion))


def in_front(low: float) -> Obstacle:
    """A bar in front of the hand, which the block alone meets, from a height on [m]."""
    return box((0.54, -0.05, low), (0.56, 0.05, low + 0.02))


def place_on_gantry(q: Array) -> Array:
    """(M, 3) places of the grasp frame: joints are x, y and z of the flange."""
    return q - (0.0, 0.0, TCP)


@pytest.mark.parametrize("room", [0.117, 0.0204])
def test_the_block_rises_to_the_bar(tmp_path: Path, room: float) -> None:
    motion = GraspMotion(standoff=0.01, least_lift=0.02)
    found = gantry(tmp_path, motion, bar=in_front(HIGH + room)).check("", X_WG)
    reserve = 0.01  # below the bar, if the least lift allows
    assert found.outcome is None
    assert found.lift == pytest.approx(max(np.floor(100 * room) / 100 - reserve, 0.02))
    assert found.blocker == "z_link vs bar" and found.path is not None
    rise = np.diff(place_on_gantry(found.path.lift)[[0, -1]], axis=0)
    np.testing.assert_allclose(rise, [[0.0, 0.0, found.lift]], atol=1e-6)


def test_less_room_than_the_least_is_a_no(tmp_path: Path) -> None:
    motion = GraspMotion(standoff=0.01, least_lift=0.02)
    found = gantry(tmp_path, motion, bar=in_front(HIGH + 0.015)).check("", X_WG)
    assert (found.outcome, found.blocker) == (Outcome.LIFT_LINE, "z_link vs bar")
    assert np.isnan(found.lift)


def test_a_joint_ends_the_lift(tmp_path: Path) -> None:
    """0.01 of what is left to the joint's end is kept."""
    high = X_WG.copy()
    high[2, 3] = UPPER[2] - TCP - 0.155
    arm = gantry(tmp_path, GraspMotion(least_lift=0.0, retreat=0.02))
    assert arm.check("", high).lift == pytest.approx(0.12)
    whole = gantry(tmp_path, GraspMotion()).check("", high)
    assert whole.outcome is Outcome.LIFT_LINE


def test_back_and_then_aside(tmp_path: Path) -> None:
    """Back is up here; what stands over the grasp, or beside its retreated place, is told."""
    motion = GraspMotion(retreat=0.08, lift_height=0.15, lift_direction=(0.0, 4.0, 3.0))
    found = gantry(tmp_path, motion).check("", X_WG)
    arm_path = found.path
    assert arm_path is not None and arm_path.retreat is not None and found.lift == 0.15
    np.testing.assert_array_equal(arm_path.approach[-1], arm_path.retreat[0])
    np.testing.assert_array_equal(arm_path.retreat[-1], arm_path.lift[0])
    ends = place_on_gantry(np.array([arm_path.retreat[0], arm_path.lift[0], arm_path.lift[-1]]))
    np.testing.assert_allclose(
        ends - X_WG[:3, 3], [[0, 0, 0], [0, 0, 0.08], [0, 0.12, 0.17]], atol=1e-6
    )
    over = gantry(tmp_path, motion, bar=in_front(HIGH + 0.05)).check("", X_WG)
    assert (over.outcome, over.blocker) == (Outcome.ARM_COLLISION, "z_link vs bar")
    short = replace(motion, standoff=0.02)
    over = gantry(tmp_path, short, bar=in_front(HIGH + 0.05)).check("", X_WG)
    assert (over.outcome, over.blocker) == (Outcome.RETREAT_LINE, "z_link vs bar")
    beside = box((0.54, 0.14, HIGH + 0.15), (0.56, 0.16, HIGH + 0.2))
    over = gantry(tmp_path, short, bar=beside).check("", X_WG)
    assert (over.outcome, over.blocker) == (Outcome.LIFT_LINE, "z_link vs bar")


# --- a Panda under a table ------------------------------------------------------------------------

MOTION = GraspMotion(retreat=0.06, lift_height=0.2, least_lift=0.0, lift_direction=(-0.3, 0.2, 1.0))


@pytest.fixture(scope="module")
def scene() -> Scene:
    scene = load_scene("tabletop_six")
    few = tuple(i for i in scene.document.instances if i.object in ("mug", "bottle", "box"))
    return Scene(replace(scene.document, instances=few), scene.library, scene.path)


@pytest.fixture(scope="module")
def station() -> Station:
    return load_station(BENCHMARKS / "confined" / "under_table.yaml")


@pytest.fixture(scope="module")
def reach(scene: Scene, station: Station) -> ArmReach:
    return ArmReach(scene, station, settings=ReachSettings(motion=MOTION))


Grasps = tuple[list[str], Array, Array]


@pytest.fixture(scope="module")
def grasps(scene: Scene, reach: ArmReach) -> Grasps:
    """From the front, two of each object, at which the open hand is clear."""
    clearance = HandClearance(build_station_diagram(scene, reach.diagram.station, robot="hand"))
    names, poses, widths = [], [], []
    for name in scene.instances:
        mesh = scene.library.surface(scene.instance(name).object)
        sampled = sample_antipodal(
            mesh, 1000, rng_from("motions", name), AntipodalSettings(friction=0.5)
        )
        X = reach.diagram.X_WO(name) @ sampled.X_OG
        front = np.flatnonzero((X[:, 0, 2] > 0.5) & clearance.is_clear(X))[:2]
        names += [name] * len(front)
        poses.append(X[front])
        widths.append(sampled.width[front])
    return names, np.concatenate(poses), np.concatenate(widths)


@pytest.fixture(scope="module")
def found(reach: ArmReach, grasps: Grasps) -> list[Reach]:
    return reach.check_all(*grasps)


def test_hand_and_target_go_back_and_up(
    reach: ArmReach, grasps: Grasps, found: list[Reach]
) -> None:
    reached = [reach for reach in found if reach.outcome is None]
    assert len(reached) > 2 and len({round(reach.lift, 3) for reach in reached}) > 1
    X_WA, X_HG = reach.diagram.station.document.arm.X_WA.matrix(), reach.diagram.station.hand.X_HG
    for one in reached:
        arm_path = one.path
        assert arm_path is not None and arm_path.retreat is not None
        ends = np.array([arm_path.retreat[0], arm_path.retreat[-1], arm_path.lift[-1]])
        X = X_WA @ reach.kinematics.forward(ends)[0] @ X_HG.matrix()
        grasp, back = arm_path.X_WG, MOTION.retreat * arm_path.X_WG[:3, 2]
        up = one.lift * MOTION.direction_W
        wanted = grasp[:3, 3] + np.array([np.zeros(3), -back, up - back])
        np.testing.assert_allclose(X[:, :3, 3], wanted, atol=1e-5)
        np.testing.assert_allclose(X[:, :3, :3], [grasp[:3, :3]] * 3, atol=1e-5)


def test_drake_sees_nothing_in_the_way(
    scene: Scene, station: Station, grasps: Grasps, found: list[Reach]
) -> None:
    """No collision checker, no filters and no bounds of the reach check; see the benchmark."""
    spec = importlib.util.spec_from_file_location("reach_audit", BENCHMARKS / "reach_audit.py")
    assert spec is not None and spec.loader is not None
    reach_audit = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = reach_audit
    spec.loader.exec_module(reach_audit)
    audit = reach_audit.Audit(scene, station)
    names, _, widths = grasps
    reached = [k for k, reach in enumerate(found) if reach.path is not None][::2]
    assert len(reached) >= 2
    for k in reached:
        assert not audit.faults(names[k], found[k].path, float(widths[k]), step=0.02), names[k]


def test_it_does_not_matter_how_a_grasp_is_given_or_with_what_others(
    reach: ArmReach, grasps: Grasps, found: list[Reach]
) -> None:
    names, X, widths = grasps
    some = [k for k, one in enumerate(found) if one.outcome is None][:1]
    some += [k for k, one in enumerate(found) if one.outcome is not None][:1]
    for k in some:
        one = reach.check(names[k], swap_fingers(X[k]), float(widths[k]))
        assert (one.outcome, one.blocker) == (found[k].outcome, found[k].blocker)
        np.testing.assert_array_equal(
            [one.lift, one.clearance], [found[k].lift, found[k].clearance]
        )
        if one.path is not None and found[k].path is not None:
            np.testing.assert_array_equal(one.path.lift, found[k].path.lift)


def test_a_turned_world_has_the_same_heights(
    scene: Scene, station: Station, grasps: Grasps, found: list[Reach]
) -> None:
    """Arm, table, board and the direction of the lift turn together."""
    turn = make_pose(rot_z(np.deg2rad(37.0)), (0.3, -0.2, 0.0))
    document, arm = station.document, station.document.arm
    assert arm is not None

    def turned(X: Pose) -> Pose:
        return Pose.from_matrix(turn @ X.matrix(), quaternion=True)

    background = {n: replace(o, X_WB=turned(o.X_WB)) for n, o in document.background.items()}
    moved = replace(
        document,
        arm=replace(arm, X_WA=turned(arm.X_WA)),
        X_WS=turned(document.X_WS),
        background=background,
        table=replace(document.table, center=(0.0, 0.0), size=(4.0, 4.0, 0.1)),
    )
    direction = tuple((turn[:3, :3] @ MOTION.direction_W).tolist())
    other = ArmReach(
        scene,
        replace(station, document=moved),
        settings=ReachSettings(motion=replace(MOTION, lift_direction=direction)),
    )
    names, X, widths = grasps
    again = other.check_all(names[::2], turn @ X[::2], widths[::2])
    for a, b in zip(found[::2], again, strict=True):
        assert (a.outcome, a.blocker) == (b.outcome, b.blocker)
        assert a.lift == pytest.approx(b.lift, abs=0.0101, nan_ok=True)


def test_a_plan_goes_back_before_it_goes_up(
    reach: ArmReach, grasps: Grasps, found: list[Reach], tmp_path: Path
) -> None:
    names, _, widths = grasps
    k = next(k for k, one in enumerate(found) if one.outcome is None and one.lift > 0.05)
    arm_path = found[k].path
    assert arm_path is not None
    plan = Planner(reach).time(names[k], arm_path, float(widths[k]))
    assert list(plan.phases) == ["transfer", "approach", "close", "retreat", "lift"]
    assert plan.retreat is not None
    np.testing.assert_array_equal(plan.retreat.q[-1], plan.lift.q[0])
    for phase, length in ((plan.retreat, MOTION.retreat), (plan.lift, found[k].lift)):
        assert not np.any([phase.v[[0, -1]], phase.a[[0, -1]]])
        p = reach.kinematics.forward(phase.q)[0][:, :3, 3]
        way = p[-1] - p[0]
        assert np.linalg.norm(way) == pytest.approx(length, abs=1e-5)
        off = (p - p[0]) - ((p - p[0]) @ way)[:, None] * way / (way @ way)
        assert np.linalg.norm(off, axis=1).max() < 5e-4
    plan.to_json(tmp_path / "plan.json")
    again = load_plan(tmp_path / "plan.json")
    assert again.retreat is not None
    np.testing.assert_array_equal(again.retreat.q, plan.retreat.q)
    np.testing.assert_array_equal(again.whole.v, plan.whole.v)
