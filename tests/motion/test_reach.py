"""The reach check against Franka's DH table, symmetries and configurations known to be free."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import (
    grasp_from_axes,
    make_pose,
    rot_z,
    rotation_angle,
    rotation_from_rpy,
    swap_fingers,
)
from burg_drake.core.outcome import Outcome
from burg_drake.core.schema import Pose
from burg_drake.grasping.clearance import HandClearance
from burg_drake.motion.reach import ArmReach, Reach, ReachSettings
from burg_drake.scene.scene import Scene, load_scene
from burg_drake.station.diagram import build_station_diagram
from burg_drake.station.station import Obstacle, Station, load_station

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


def grasp_by_dh(q: np.ndarray) -> np.ndarray:
    """`X_AG` (4, 4) of one configuration."""
    X = np.eye(4)
    for (a, d, alpha), theta in zip(DH, [*q, 0.0], strict=True):
        X = X @ make_pose(rotation_from_rpy((alpha, 0, 0)), (a, 0, 0))
        X = X @ make_pose(rotation_from_rpy((0, 0, theta)), (0, 0, d))
    return X @ X_FG


def random_grasps(n: int, seed: int = 0) -> list[np.ndarray]:
    """Grasps over and around the board of `panda_tabletop`, mostly from above."""
    rng = np.random.default_rng(seed)
    approach = rng.normal(size=(n, 3)) + np.array([0.0, 0.0, -1.5])
    place = rng.uniform((0.2, -0.35, 0.02), (0.75, 0.35, 0.35), (n, 3))
    return list(grasp_from_axes(rng.normal(size=(n, 3)), approach, place))


def same(a: Reach, b: Reach) -> bool:
    return (
        a.outcome == b.outcome
        and a.blocker == b.blocker
        and np.array_equal(a.q_grasp, b.q_grasp)
        and np.array_equal(a.q_pregrasp, b.q_pregrasp)
    )


@pytest.fixture(scope="module")
def station() -> Station:
    return load_station("panda_tabletop")


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
def verdicts(arm: ArmReach) -> list[tuple[np.ndarray, Reach]]:
    return [(X_WG, arm.check(X_WG)) for X_WG in random_grasps(150)]


@pytest.fixture
def changed(station: Station) -> Callable[..., Station]:
    """Makes a station that differs from `panda_tabletop` in some keys."""

    def make(**changes: object) -> Station:
        return replace(station, document=replace(station.document, **changes))  # type: ignore[arg-type]

    return make


def test_all_three_verdicts_are_seen(verdicts: list[tuple[np.ndarray, Reach]]) -> None:
    counts = [
        sum(found.outcome == outcome for _, found in verdicts)
        for outcome in (None, Outcome.NO_IK, Outcome.ARM_COLLISION)
    ]
    assert min(counts) >= 15, counts


def test_configurations_put_the_hand_at_grasp_and_pregrasp(
    verdicts: list[tuple[np.ndarray, Reach]],
) -> None:
    for X_WG, found in verdicts:
        if found.outcome is not None:
            assert found.q_grasp is None and found.q_pregrasp is None
            continue
        assert found.q_grasp is not None and found.q_pregrasp is not None and not found.blocker
        X = grasp_by_dh(found.q_grasp)
        goal = X_WG if X[:3, 0] @ X_WG[:3, 0] > 0 else swap_fingers(X_WG)
        back = goal @ make_pose(p_AB=(0, 0, -0.1))
        for q, X_goal in ((found.q_grasp, goal), (found.q_pregrasp, back)):
            X = grasp_by_dh(q)
            assert np.linalg.norm(X[:3, 3] - X_goal[:3, 3]) < 1e-5
            assert rotation_angle(X[:3, :3].T @ X_goal[:3, :3]) < 1e-5
        assert np.abs(found.q_grasp - found.q_pregrasp).max() <= 1.0


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
        for q in (found.q_grasp, found.q_pregrasp):
            if q is None:
                continue
            plant.SetPositions(plant_context, plant.GetModelInstanceByName("arm"), q)
            query = fresh.diagram.GetOutputPort("geometry_query").Eval(context)
            for pair in query.ComputePointPairPenetration():
                frames = [query.inspector().GetFrameId(g) for g in (pair.id_A, pair.id_B)]
                bodies = {plant.GetBodyFromFrameId(frame).index() for frame in frames}
                assert not bodies & robot
            checked += 1
    assert checked > 100


def test_free_configurations_are_found_again(scene: Scene, station: Station) -> None:
    arm = ArmReach(scene, station, settings=ReachSettings(standoff=0.0))
    rng = np.random.default_rng(11)
    lower, upper = arm.kinematics.lower + 0.01, arm.kinematics.upper - 0.01
    found = total = 0
    while total < 100:
        q = rng.uniform(lower, upper)
        if arm.collision.is_free(q):
            total += 1
            found += arm.check(grasp_by_dh(q)).outcome is None
    assert found >= 98


def test_what_the_numeric_search_reaches_the_closed_form_reaches(
    scene: Scene, station: Station, verdicts: list[tuple[np.ndarray, Reach]]
) -> None:
    numeric = ArmReach(scene, station, settings=ReachSettings(closed_form=False))
    pairs = [(found.outcome, numeric.check(X_WG).outcome) for X_WG, found in verdicts[:60]]
    reached = [closed for closed, other in pairs if other is None]
    assert len(reached) > 15 and reached == [None] * len(reached)


def test_swapped_fingers_are_the_same_grasp(
    arm: ArmReach, verdicts: list[tuple[np.ndarray, Reach]]
) -> None:
    for X_WG, found in verdicts[:50]:
        assert same(arm.check(swap_fingers(X_WG)), found)


def test_a_verdict_depends_on_the_grasp_alone(
    scene: Scene, station: Station, verdicts: list[tuple[np.ndarray, Reach]]
) -> None:
    other = ArmReach(scene, station)
    for X_WG, found in reversed(verdicts[:60]):
        assert same(other.check(X_WG), found)


def test_a_turned_world_has_the_same_verdicts(
    scene: Scene, changed: Callable[..., Station]
) -> None:
    """Arm and board turn and move together on a table that is large enough for both places."""
    table = replace(changed().document.table, center=(0.0, 0.0), size=(4.0, 4.0, 0.1))
    X_WV = make_pose(rot_z(np.deg2rad(37.0)), (0.3, -0.2, 0.0))
    before = changed(table=table)
    assert before.document.arm is not None
    arm_after = replace(
        before.document.arm, X_WA=Pose.from_matrix(X_WV @ before.document.arm.X_WA.matrix())
    )
    X_WS = Pose.from_matrix(X_WV @ before.document.X_WS.matrix())
    after = changed(table=table, arm=arm_after, X_WS=X_WS)
    one, other = ArmReach(scene, before), ArmReach(scene, after)
    for X_WG in random_grasps(60, seed=3):
        a, b = one.check(X_WG), other.check(X_WV @ X_WG)
        assert a.outcome == b.outcome
        if a.q_grasp is not None and b.q_grasp is not None:
            np.testing.assert_allclose(a.q_grasp, b.q_grasp, atol=1e-6)


def test_beyond_the_arms_length(arm: ArmReach) -> None:
    directions = np.random.default_rng(2).normal(size=(10, 3))
    for direction in directions / np.linalg.norm(directions, axis=1, keepdims=True):
        place = SHOULDER + (LONGEST + 1e-3) * direction
        closing = np.cross(direction, (0.3, 0.2, 0.9))
        found = arm.check(grasp_from_axes(closing, direction, place))
        assert found.outcome is Outcome.NO_IK
        assert found.blocker == "" and found.q_grasp is None


def test_pregrasp_beyond_the_arms_length(empty: Scene, station: Station) -> None:
    """0.4 m above the grasp the hand would still be in reach, but not the wrist over it: at least
    0.36 m in front of the shoulder and 0.777 m above it, where upper arm and forearm measure
    0.72 m."""
    X_WG = grasp_from_axes((0, 1, 0), DOWN, (0.45, 0.0, 0.5))
    for standoff, outcome in ((0.0, None), (0.1, None), (0.4, Outcome.NO_IK)):
        arm = ArmReach(empty, station, settings=ReachSettings(standoff=standoff))
        assert arm.check(X_WG).outcome == outcome, standoff


@pytest.mark.parametrize("depth", [0.03, 0.10, 0.30])
def test_in_and_under_the_table(arm: ArmReach, depth: float) -> None:
    from_above = arm.check(grasp_from_axes((0, 1, 0), DOWN, (0.45, 0.0, -depth)))
    assert from_above.outcome in (Outcome.ARM_COLLISION, Outcome.NO_IK)
    from_below = arm.check(grasp_from_axes((0, 1, 0), (0, 0, 1), (0.45, 0.0, -depth)))
    assert from_below.outcome in (Outcome.ARM_COLLISION, Outcome.NO_IK)


def test_a_hand_in_the_table_names_it(empty: Scene, station: Station) -> None:
    found = ArmReach(empty, station).check(grasp_from_axes((0, 1, 0), DOWN, (0.45, 0.0, -0.03)))
    assert found.outcome is Outcome.ARM_COLLISION
    assert found.blocker.endswith("finger vs table")


def test_a_wall_behind_the_hand_is_in_the_way_of_the_pregrasp(
    empty: Scene, changed: Callable[..., Station]
) -> None:
    """The wall is 0.32 m behind the grasp, and the wrist reaches 0.29 m back from the TCP: 0.2104 m
    to the axes of the last two joints, and the thickness of the links there."""
    X_WG = grasp_from_axes((0, 1, 0), (1, 0, 0), (0.6, 0.0, 0.15))
    wall = Obstacle(X_WB=Pose((0.27, 0.0, 0.1)), size=(0.02, 0.4, 0.2))
    free, blocked = changed(), changed(background={"wall": wall})
    assert ArmReach(empty, free).check(X_WG).outcome is None
    at_once = ReachSettings(standoff=0.0)
    assert ArmReach(empty, blocked, settings=at_once).check(X_WG).outcome is None
    found = ArmReach(empty, blocked).check(X_WG)
    assert found.outcome is Outcome.ARM_COLLISION
    assert found.blocker.startswith("panda_") and found.blocker.endswith(" vs wall")


def test_a_roof_is_in_the_way_of_the_arm_and_not_of_the_hand(
    empty: Scene, changed: Callable[..., Station]
) -> None:
    """From above the hand's base is 0.10 m over the grasp; the roof is 0.2 m over it."""
    X_WG = grasp_from_axes((0, 1, 0), DOWN, (0.5, 0.0, 0.05))
    roof = Obstacle(X_WB=Pose((0.5, 0.0, 0.26)), size=(0.3, 0.5, 0.02))
    blocked = changed(background={"roof": roof})
    hand = HandClearance(build_station_diagram(empty, blocked, robot="hand"))
    assert hand.check("", X_WG).outcome is None
    assert ArmReach(empty, changed()).check(X_WG).outcome is None
    found = ArmReach(empty, blocked, settings=ReachSettings(standoff=0.0)).check(X_WG)
    assert found.outcome is Outcome.ARM_COLLISION
    assert found.blocker.endswith(" vs roof")


def test_home_in_collision(empty: Scene, changed: Callable[..., Station]) -> None:
    post = Obstacle(X_WB=Pose((0.31, 0.0, 0.225)), size=(0.02, 0.02, 0.65))
    with pytest.raises(InvalidInputError) as error:
        ArmReach(empty, changed(background={"post": post}))
    message = str(error.value)
    assert "\n" not in message
    assert "panda_tabletop.yaml: arm.home collides in scene 'tabletop_six': " in message
    assert "panda_hand with post" in message
    assert message.endswith("; change the posture or move what is in the way")


def test_home_folded_into_itself(empty: Scene, changed: Callable[..., Station]) -> None:
    arm = changed().document.arm
    assert arm is not None
    folded = changed(arm=replace(arm, home=(0.0, 0.0, 0.0, -3.0, 0.0, 0.1, 0.0)))
    with pytest.raises(InvalidInputError, match=r"arm\.home collides .*panda_\w+ with panda_link"):
        ArmReach(empty, folded)


def test_station_without_an_arm(empty: Scene, changed: Callable[..., Station]) -> None:
    with pytest.raises(InvalidInputError, match=r"has no arm; add an 'arm:' section"):
        ArmReach(empty, changed(arm=None))


def test_bad_grasps(arm: ArmReach) -> None:
    with pytest.raises(InvalidInputError, match="X_WG has NaN"):
        arm.check(np.full((4, 4), np.nan))
    with pytest.raises(InvalidInputError, match="X_WG is not a rigid transform"):
        arm.check(np.diag([1.0, 1.0, -1.0, 1.0]))


@pytest.mark.parametrize(
    "wrong",
    [
        *({"standoff": -0.1}, {"joint_travel": 0.0}),
        *({"starts": ()}, {"starts": (0,)}, {"redundant": ()}, {"redundant": (32, 0)}),
    ],
)
def test_bad_settings(wrong: dict[str, object]) -> None:
    with pytest.raises(InvalidInputError, match="must be"):
        ReachSettings(**wrong)  # type: ignore[arg-type]


def test_built_in_stations_reach_their_board(empty: Scene) -> None:
    """From above, 5 cm over the middle of the sheet and 5 cm inside each corner of it."""
    x, y = empty.board.size
    places = [(x / 2, y / 2), *((a, b) for a in (0.05, x - 0.05) for b in (0.05, y - 0.05))]
    for path in sorted(Path(load_station("panda_tabletop").path).parent.glob("*.yaml")):
        station = load_station(path)
        if station.document.arm is None:
            continue
        arm = ArmReach(empty, station)
        for place in places:
            X_SG = grasp_from_axes((1, 0, 0), DOWN, (*place, 0.05))
            found = arm.check(station.document.X_WS.matrix() @ X_SG)
            assert found.outcome is None, (path.name, place, found.blocker)
