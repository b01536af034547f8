"""The reach check against Franka's DH table, symmetries and configurations known to be free."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from math import pi

import numpy as np
import pytest

from burg_drake.core import (
    InvalidInputError,
    Outcome,
    Pose,
    grasp_from_axes,
    make_pose,
    rot_z,
    rotation_angle,
    rotation_from_rpy,
    swap_fingers,
)
from burg_drake.grasping import HandClearance
from burg_drake.motion import ArmReach, Reach, ReachSettings
from burg_drake.scene import Scene, load_scene
from burg_drake.station import GraspMotion, Obstacle, Station, build_station_diagram, load_station

# Craig's DH table (a, d, alpha) of frankaemika.github.io/docs/control_parameters.html; flange last.
DH = [
    (0.0, 0.333, 0.0),
    (0.0, 0.0, -pi / 2),
    (0.0, 0.316, pi / 2),
    (0.0825, 0.0, pi / 2),
    (-0.0825, 0.384, -pi / 2),
    (0.0, 0.0, pi / 2),
    (0.088, 0.0, pi / 2),
    (0.0, 0.107, 0.0),
]
X_FG = make_pose(rot_z(-pi / 4), (0.0, 0.0, 0.0)) @ make_pose(rot_z(pi / 2), (0.0, 0.0, 0.1034))
"""Grasp frame in the flange: the hand is turned by -45 degrees, the TCP 0.1034 m in front of it."""
LONGEST = np.hypot(0.316, 0.0825) + np.hypot(0.384, 0.0825) + np.hypot(0.088, 0.107 + 0.1034)
"""The TCP is never farther from the shoulder: upper arm, forearm, wrist to TCP in a line [m]."""
SHOULDER = np.array([0.0, 0.0, 0.333])
DOWN = (0.0, 0.0, -1.0)


def barely_lifted(standoff: float) -> ReachSettings:
    """With a lift of 1 mm, the least there is."""
    return ReachSettings(motion=GraspMotion(standoff=standoff, lift_height=1e-3))


AT_ONCE = barely_lifted(0.0)


def grasp_by_dh(q: np.ndarray) -> np.ndarray:
    """`X_AG` (N, 4, 4) of configurations (N, 7)."""
    X = np.eye(4)
    for k, (a, d, alpha) in enumerate(DH):
        turn = np.zeros((len(q), 3))
        turn[:, 2] = q[:, k] if k < 7 else 0.0
        along = np.repeat([[0.0, 0.0, d]], len(q), axis=0)
        X = X @ make_pose(rotation_from_rpy((alpha, 0, 0)), (a, 0, 0))
        X = X @ make_pose(rotation_from_rpy(turn), along)
    return X @ X_FG


def random_grasps(n: int, seed: int = 0) -> list[np.ndarray]:
    """Grasps over and around the board of `panda_tabletop`, mostly from above."""
    rng = np.random.default_rng(seed)
    approach = rng.normal(size=(n, 3)) + np.array([0.0, 0.0, -1.5])
    place = rng.uniform((0.2, -0.35, 0.02), (0.75, 0.35, 0.35), (n, 3))
    return list(grasp_from_axes(rng.normal(size=(n, 3)), approach, place))


def same(a: Reach, b: Reach) -> bool:
    return (
        (a.outcome, a.blocker) == (b.outcome, b.blocker)
        and np.array_equal([a.clearance, a.excess], [b.clearance, b.excess], equal_nan=True)
        and (a.path is None) == (b.path is None)
        and all(np.array_equal(p, q) for p, q in zip(parts(a), parts(b), strict=True))
    )


def parts(found: Reach) -> list[np.ndarray]:
    arm_path = found.path
    if arm_path is None:
        return []
    return [arm_path.transfer, arm_path.approach, arm_path.lift, arm_path.X_WG]


@pytest.fixture(scope="module")
def station() -> Station:
    """On a table that is large enough for arm and board at another place, too."""
    usual = load_station("panda_tabletop")
    table = replace(usual.document.table, center=(0.0, 0.0), size=(4.0, 4.0, 0.1))
    return replace(usual, document=replace(usual.document, table=table))


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene("tabletop_six")


@pytest.fixture(scope="module")
def empty(scene: Scene) -> Scene:
    return Scene(replace(scene.document, instances=(), background=()), scene.library, scene.path)


@pytest.fixture(scope="module")
def arm(scene: Scene, station: Station) -> ArmReach:
    return ArmReach(scene, station)


@pytest.fixture(scope="module")
def bare(empty: Scene, station: Station) -> ArmReach:
    """Over the table alone, with hardly any lift."""
    return ArmReach(empty, station, settings=barely_lifted(0.1))


@pytest.fixture(scope="module")
def verdicts(arm: ArmReach) -> list[tuple[np.ndarray, Reach]]:
    grasps = np.array(random_grasps(150)[:100])
    return list(zip(grasps, arm.check_all([""] * len(grasps), grasps), strict=True))


@pytest.fixture
def changed(station: Station) -> Callable[..., Station]:
    """Makes a station that differs from `panda_tabletop` in some keys."""

    def make(**changes: object) -> Station:
        return replace(station, document=replace(station.document, **changes))  # type: ignore[arg-type]

    return make


def test_many_verdicts_are_seen(verdicts: list[tuple[np.ndarray, Reach]]) -> None:
    counts = Counter(found.outcome for _, found in verdicts)
    for outcome in (None, Outcome.HAND_COLLISION_APPROACH, Outcome.NO_IK, Outcome.ARM_COLLISION):
        assert counts[outcome] >= 5, counts
    assert counts[Outcome.JOINT_LIMIT] and counts[Outcome.LIFT_LINE], counts


def test_a_witness_leads_from_home_straight_to_the_grasp_and_straight_up(
    verdicts: list[tuple[np.ndarray, Reach]], station: Station
) -> None:
    """By the DH table, at rows and half-way between them."""
    assert station.document.arm is not None
    for X_WG, found in verdicts:
        arm_path = found.path
        if arm_path is None:
            assert found.outcome is not None and found.q_grasp is None
            continue
        assert found.outcome is None and not found.blocker and found.clearance >= 0.0
        np.testing.assert_array_equal(arm_path.transfer[0], station.document.arm.home)
        np.testing.assert_array_equal(arm_path.transfer[-1], arm_path.approach[0])
        np.testing.assert_array_equal(arm_path.approach[-1], arm_path.lift[0])
        goal = arm_path.X_WG
        assert min(np.abs(goal - X).max() for X in (X_WG, swap_fingers(X_WG))) < 1e-12
        assert on_line(arm_path.approach, goal, goal[:3, 2], -0.1, 0.0) < 1e-3
        assert on_line(arm_path.lift, goal, np.array([0.0, 0.0, 1.0]), 0.0, 0.3) < 1e-3


def on_line(
    rows: np.ndarray, X_WG: np.ndarray, direction: np.ndarray, begin: float, end: float
) -> float:
    """How far the hand strays from its straight segment [m, and rad on a lever of 0.1 m]."""
    halfway = 0.5 * (rows[1:] + rows[:-1])
    X = grasp_by_dh(np.concatenate([rows, halfway]))
    p = X[:, :3, 3] - X_WG[:3, 3]
    along = p @ direction
    np.testing.assert_allclose([along[0], along[len(rows) - 1]], [begin, end], atol=1e-6)
    assert (np.diff(along[: len(rows)]) > 0.0).all()
    beside = np.linalg.norm(p - along[:, None] * direction, axis=1)
    turned = rotation_angle(X[:, :3, :3].swapaxes(-1, -2) @ X_WG[:3, :3])
    return float((beside + 0.1 * turned).max())


@pytest.mark.thorough
def test_configurations_are_free_in_a_fresh_diagram(
    verdicts: list[tuple[np.ndarray, Reach]], scene: Scene, station: Station
) -> None:
    """Contact that is there must involve the robot on neither side; Drake's filters, not ours."""
    fresh = build_station_diagram(scene, station, robot="arm")
    plant, context = fresh.plant, fresh.diagram.CreateDefaultContext()
    plant_context = plant.GetMyMutableContextFromRoot(context)
    robot = set(fresh.robot_bodies)
    checked = 0
    for _, found in verdicts:
        if found.path is None:
            continue
        for q in np.concatenate([found.path.transfer, found.path.approach[::2]]):
            plant.SetPositions(plant_context, plant.GetModelInstanceByName("arm"), q)
            query = fresh.diagram.GetOutputPort("geometry_query").Eval(context)
            for pair in query.ComputePointPairPenetration():
                frames = [query.inspector().GetFrameId(g) for g in (pair.id_A, pair.id_B)]
                bodies = {plant.GetBodyFromFrameId(frame).index() for frame in frames}
                assert not bodies & robot
            checked += 1
    assert checked > 100


@pytest.mark.thorough
def test_free_configurations_are_found_again(scene: Scene, station: Station) -> None:
    arm = ArmReach(scene, station, settings=AT_ONCE)
    rng = np.random.default_rng(11)
    lower, upper = arm.kinematics.lower + 0.01, arm.kinematics.upper - 0.01
    drawn = (rng.uniform(lower, upper) for _ in range(100))
    free = [q for q in drawn if arm._tree.edges.collision.is_free(q)][:16]
    assert len(free) == 16
    found = arm.check_all([""] * 16, grasp_by_dh(np.array(free)))
    missed = [q for q, reach in zip(free, found, strict=True) if reach.outcome is not None]
    assert sum(path is not None for q in missed for path in arm._tree.connect(q[None])) <= 1


@pytest.mark.thorough
def test_what_the_numeric_search_reaches_the_closed_form_reaches(
    scene: Scene, station: Station, verdicts: list[tuple[np.ndarray, Reach]]
) -> None:
    numeric = ArmReach(scene, station, settings=ReachSettings(closed_form=False))
    grasps = np.array([X_WG for X_WG, _ in verdicts[:16]])
    others = numeric.check_all([""] * 16, grasps)
    pairs = zip(verdicts, others, strict=False)
    reached = [found.outcome for (_, found), other in pairs if other.outcome is None]
    assert len(reached) > 5 and reached == [None] * len(reached)


def test_swapped_fingers_are_the_same_grasp(
    arm: ArmReach, verdicts: list[tuple[np.ndarray, Reach]]
) -> None:
    for X_WG, found in verdicts[:8]:
        assert same(arm.check("", swap_fingers(X_WG)), found)


def test_a_verdict_depends_on_the_grasp_alone(
    scene: Scene, station: Station, verdicts: list[tuple[np.ndarray, Reach]]
) -> None:
    """Judged before others in another order, and alone, it is the same to the last bit."""
    other = ArmReach(scene, station)
    backwards = verdicts[24::-1]
    again = other.check_all([""] * 25, np.array([X_WG for X_WG, _ in backwards]))
    for (_, found), reach in zip(backwards, again, strict=True):
        assert same(reach, found)
    for X_WG, found in verdicts[:8]:
        assert same(other.check("", X_WG), found)


def test_a_turned_world_has_the_same_verdicts(
    scene: Scene,
    changed: Callable[..., Station],
    verdicts: list[tuple[np.ndarray, Reach]],
) -> None:
    """Arm and board turn and move together on the table."""
    before = changed().document
    X_WV = make_pose(rot_z(np.deg2rad(37.0)), (0.3, -0.2, 0.0))
    assert before.arm is not None
    arm = replace(before.arm, X_WA=Pose.from_matrix(X_WV @ before.arm.X_WA.matrix()))
    after = changed(arm=arm, X_WS=Pose.from_matrix(X_WV @ before.X_WS.matrix()))
    some = verdicts[:16]
    turned = ArmReach(scene, after).check_all([""] * 16, X_WV @ np.array([X for X, _ in some]))
    for (_, a), b in zip(some, turned, strict=True):
        assert (a.outcome, a.blocker) == (b.outcome, b.blocker)
        if a.outcome is not None:  # else a lower bound, by boxes that lie along the axes
            np.testing.assert_allclose([b.clearance, b.excess], [a.clearance, a.excess], atol=1e-4)


def test_beyond_the_arms_length(arm: ArmReach) -> None:
    directions = np.random.default_rng(2).normal(size=(10, 3))
    directions[:, 2] = np.abs(directions[:, 2])
    for direction in directions / np.linalg.norm(directions, axis=1, keepdims=True):
        place = SHOULDER + (LONGEST + 1e-3) * direction
        closing = np.cross(direction, (0.3, 0.2, 0.9))
        found = arm.check("", grasp_from_axes(closing, direction, place))
        assert found.outcome is Outcome.NO_IK
        assert found.blocker == "" and found.q_grasp is None


def test_pregrasp_beyond_the_arms_length(empty: Scene, station: Station, bare: ArmReach) -> None:
    """0.4 m above the grasp the hand would still be in reach, but not the wrist over it: at least
    0.36 m in front of the shoulder and 0.777 m above it, where upper arm and forearm measure
    0.72 m."""
    X_WG = grasp_from_axes((0, 1, 0), DOWN, (0.45, 0.0, 0.5))
    assert bare.check("", X_WG).outcome is None
    far = ArmReach(empty, station, settings=barely_lifted(0.4))
    assert far.check("", X_WG).outcome is Outcome.NO_IK


@pytest.mark.parametrize("depth", [0.03, 0.10, 0.30])
def test_in_and_under_the_table(arm: ArmReach, depth: float) -> None:
    from_above = arm.check("", grasp_from_axes((0, 1, 0), DOWN, (0.45, 0.0, -depth)))
    assert from_above.outcome is Outcome.HAND_COLLISION_APPROACH
    from_below = arm.check("", grasp_from_axes((0, 1, 0), (0, 0, 1), (0.45, 0.0, -depth)))
    assert from_below.outcome in (Outcome.HAND_COLLISION_APPROACH, Outcome.HAND_COLLISION_LIFT)


def test_a_hand_in_the_table_names_it(bare: ArmReach) -> None:
    found = bare.check("", grasp_from_axes((0, 1, 0), DOWN, (0.45, 0.0, -0.03)))
    assert found.outcome is Outcome.HAND_COLLISION_APPROACH
    assert found.blocker == "table" and found.clearance == pytest.approx(-0.0395, abs=1e-3)


def test_a_wall_behind_the_hand_is_in_the_way_of_the_pregrasp(
    empty: Scene, changed: Callable[..., Station], bare: ArmReach
) -> None:
    """The wall is 0.32 m behind the grasp, and the wrist reaches 0.29 m back from the TCP: 0.2104 m
    to the axes of the last two joints, and the thickness of the links there."""
    X_WG = grasp_from_axes((0, 1, 0), (1, 0, 0), (0.6, 0.0, 0.15))
    wall = Obstacle(X_WB=Pose((0.27, 0.0, 0.1)), size=(0.02, 0.4, 0.2))
    blocked, no_lift = changed(background={"wall": wall}), barely_lifted(0.1)
    assert bare.check("", X_WG).outcome is None
    assert ArmReach(empty, blocked, settings=AT_ONCE).check("", X_WG).outcome is None
    found = ArmReach(empty, blocked, settings=no_lift).check("", X_WG)
    assert found.outcome is Outcome.ARM_COLLISION and found.clearance < 0.0
    assert found.blocker.startswith("panda_") and found.blocker.endswith(" vs wall")


def test_a_roof_is_in_the_way_of_the_arm_and_not_of_the_hand(
    empty: Scene, changed: Callable[..., Station], bare: ArmReach
) -> None:
    """From above the hand's base is 0.10 m over the grasp; the roof is 0.2 m over it."""
    X_WG = grasp_from_axes((0, 1, 0), DOWN, (0.5, 0.0, 0.05))
    roof = Obstacle(X_WB=Pose((0.5, 0.0, 0.26)), size=(0.3, 0.5, 0.02))
    blocked = changed(background={"roof": roof})
    hand = HandClearance(build_station_diagram(empty, blocked, robot="hand"))
    assert hand.check("", X_WG).outcome is None
    assert bare.check("", X_WG).outcome is None
    found = ArmReach(empty, blocked, settings=AT_ONCE).check("", X_WG)
    assert found.outcome is Outcome.ARM_COLLISION
    assert found.blocker.endswith(" vs roof")


def test_home_in_collision(empty: Scene, changed: Callable[..., Station]) -> None:
    post = Obstacle(X_WB=Pose((0.31, 0.0, 0.225)), size=(0.02, 0.02, 0.65))
    with pytest.raises(InvalidInputError) as error:
        ArmReach(empty, changed(background={"post": post}))
    message = str(error.value)
    assert "\n" not in message
    assert "panda_tabletop.yaml: at arm.home the arm collides in scene 'tabletop_six': " in message
    assert "panda_hand with post" in message
    assert message.endswith("; change arm.home or move the obstacle")


def test_home_folded_into_itself(empty: Scene, changed: Callable[..., Station]) -> None:
    arm = changed().document.arm
    assert arm is not None
    folded = changed(arm=replace(arm, home=(0.0, 0.0, 0.0, -3.0, 0.0, 0.1, 0.0)))
    with pytest.raises(
        InvalidInputError, match=r"at arm\.home the arm collides .*panda_\w+ with panda_link"
    ):
        ArmReach(empty, folded)


def test_station_without_an_arm(empty: Scene, changed: Callable[..., Station]) -> None:
    with pytest.raises(InvalidInputError, match=r"has no arm; add an 'arm:' section"):
        ArmReach(empty, changed(arm=None))


def test_bad_grasps(arm: ArmReach) -> None:
    with pytest.raises(InvalidInputError, match="X_WG has NaN"):
        arm.check("", np.full((4, 4), np.nan))
    with pytest.raises(InvalidInputError, match="X_WG is not a rigid transform"):
        arm.check("", np.diag([1.0, 1.0, -1.0, 1.0]))


@pytest.mark.parametrize(
    "wrong",
    [
        *({"limit_margin": -0.1}, {"joint_travel": 0.0}),
        *({"starts": ()}, {"starts": (0,)}, {"redundant": ()}, {"redundant": (32, 0)}),
    ],
)
def test_bad_settings(wrong: dict[str, object]) -> None:
    with pytest.raises(InvalidInputError, match=r" be at least 0|give whole numbers above 0"):
        ReachSettings(**wrong)  # type: ignore[arg-type]
