"""Collision checks against configurations whose contacts are known by construction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import InvalidInputError, Pose, UnknownNameError, inverse
from burg_drake.motion import ArmCollision, ArmProximity
from burg_drake.scene import Instance, Scene, SceneDocument, load_scene
from burg_drake.station import Obstacle, Station, build_station_diagram, load_station

HOME = np.array((0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4))
HAND = (0.30689, 0.0, 0.59028)
"""Origin of the hand at home [m]; it points down, its fingers 0.04 m to either side along y."""
FINGERTIP = 0.0584 + 0.04525 + 0.0185 / 2
"""From the origin of the hand to the end of a pad [m]: finger joint, centre of the pad, half of its
height (franka_ros, franka_hand.xacro)."""


@pytest.fixture(scope="module")
def station() -> Station:
    return load_station("panda_tabletop")


def collision(station: Station, *instances: Instance, **background: Obstacle) -> ArmCollision:
    library = load_scene("tabletop_six").library
    document = SceneDocument(name="few", library="household", instances=instances)
    scene = Scene(document, library, Path("few.yaml"))
    changed = replace(station, document=replace(station.document, background=background))
    return ArmCollision(build_station_diagram(scene, changed, weld_objects=True))


def scene_pose(
    station: Station,
    p_WO: tuple[float, float, float],
    rpy_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Pose:
    """`X_SO` of what is to stand at a pose in the world."""
    X_WO = Pose(p_WO, rpy_deg).matrix()
    return Pose.from_matrix(inverse(station.document.X_WS.matrix()) @ X_WO, quaternion=True)


def test_home_is_free(station: Station) -> None:
    checked = collision(station)
    assert checked.overlaps(HOME) == []
    assert checked.is_free(HOME)
    assert [joint.name() for joint in checked.joints] == [f"panda_joint{i}" for i in range(1, 8)]


def test_bodies_left_out_do_not_meet_within_the_joints_limits() -> None:
    """Drake's plain checker says the same of every configuration, folded ones above all."""
    station, scene = load_station("panda_tabletop"), load_scene("tabletop_six")
    diagram = build_station_diagram(scene, station, weld_objects=True)
    apart = ArmProximity(diagram).apart
    checked = ArmCollision(diagram, apart=apart)
    links = {tuple(sorted(diagram.body_names[body] for body in pair)) for pair in apart}
    assert ("panda_link2", "panda_link4") in links and ("panda_link0", "panda_link4") not in links
    joints = checked.joints
    lower = np.array([joint.position_lower_limits()[0] for joint in joints])
    upper = np.array([joint.position_upper_limits()[0] for joint in joints])
    rng = np.random.default_rng(8)
    q = rng.uniform(lower, upper, (300, len(joints)))
    q[::2] = np.where(rng.uniform(size=q[::2].shape) < 0.5, lower, upper)
    verdicts = [checked.is_free(row) for row in q]
    plain = checked.checker
    assert verdicts == [plain.CheckConfigCollisionFree(checked.configuration(row)) for row in q]
    assert 25 < sum(verdicts) < 275


@pytest.mark.parametrize(("gap", "touching"), [(1e-3, False), (-1e-3, True)])
def test_the_open_finger_and_a_post_by_a_millimetre(
    station: Station, gap: float, touching: bool
) -> None:
    """A post stands under the middle of the pad, which is 15.2 mm thick."""
    x, _, z = HAND
    top = z - FINGERTIP - gap
    post = Obstacle(X_WB=Pose((x, 0.04 + 0.0076, top - 0.05)), size=(0.01, 0.01, 0.1))
    checked = collision(station, post=post)
    overlaps = checked.overlaps(HOME)
    assert checked.is_free(HOME) is not touching
    assert bool(overlaps) is touching
    if touching:
        (overlap,) = overlaps
        assert str(overlap) in ("panda_leftfinger vs post", "panda_rightfinger vs post")
        assert overlap.depth == pytest.approx(-gap, abs=1e-4)
        assert overlap.carried


@pytest.mark.parametrize("width", [0.0, 0.03, 0.08, np.nan])
def test_fingers_are_as_far_apart_as_the_grasp_is_wide(station: Station, width: float) -> None:
    """A post under the middle of a pad, where that is at this distance of the pads alone.

    The pads' faces are half of the width from the middle; NaN is the open hand, 0.08 m.
    """
    x, _, z = HAND
    apart = 0.08 if np.isnan(width) else width
    y = apart / 2 + 0.0076
    post = Obstacle(X_WB=Pose((x, y, z - FINGERTIP + 1e-3 - 0.05)), size=(0.004, 0.004, 0.1))
    checked = collision(station, post=post)
    touching = {asked: checked.overlaps(HOME, width=asked) for asked in (0.0, 0.03, 0.08, np.nan)}
    for asked, overlaps in touching.items():
        same = apart == (0.08 if np.isnan(asked) else asked)
        assert [o.other for o in overlaps] == (["post"] if same else [])
        assert checked.is_free(HOME, width=asked) is not same


def test_the_arm_itself(station: Station) -> None:
    folded = np.array((0.0, 0.0, 0.0, -3.0, 0.0, 0.1, 0.0))
    checked = collision(station)
    overlaps = checked.overlaps(folded)
    assert overlaps and not checked.is_free(folded)
    assert all(o.link.startswith("panda_") and o.other.startswith("panda_") for o in overlaps)
    assert not any(o.carried for o in overlaps)
    assert [o.depth for o in overlaps] == sorted((o.depth for o in overlaps), reverse=True)


def test_a_link_that_is_not_carried(station: Station) -> None:
    """A post through the upper arm, half way between shoulder and elbow, which leans back."""
    halfway = 0.158 * np.sqrt(0.5)
    post = Obstacle(X_WB=Pose((-halfway, 0.0, 0.333 + halfway)), size=(0.02, 1.0, 0.02))
    overlaps = collision(station, post=post).overlaps(HOME)
    assert {o.other for o in overlaps} == {"post"}
    assert {o.link for o in overlaps} <= {"panda_link2", "panda_link3"}
    assert not any(o.carried for o in overlaps)


def test_objects_among_themselves_do_not_count(station: Station) -> None:
    """Two cans in one place, sunk into the table: what the scene's own checks are for."""
    cans = [
        Instance(name=name, object="can", X_SO=Pose((0.3, 0.2, -0.02))) for name in ("one", "two")
    ]
    checked = collision(station, *cans)
    assert checked.overlaps(HOME) == [] and checked.is_free(HOME)


def test_both_ways_to_ask_agree(station: Station) -> None:
    can = Instance(name="can", object="can", X_SO=Pose((0.3, 0.2, 0.0)))
    checked = collision(station, can)
    limits = [(j.position_lower_limits()[0], j.position_upper_limits()[0]) for j in checked.joints]
    postures = np.random.default_rng(7).uniform(*np.transpose(limits), (200, 7))
    answers = [(checked.is_free(q), not checked.overlaps(q)) for q in postures]
    assert all(a == b for a, b in answers)
    assert 20 < sum(a for a, _ in answers) < 195


def test_what_is_carried_counts_against_the_links_alone(station: Station) -> None:
    """A can that reaches into the palm; then lifted into the wrist."""
    x, y, z = HAND
    can = Instance(name="can", object="can", X_SO=scene_pose(station, (x, y, z - 0.12)))
    checked = collision(station, can)
    assert [str(o) for o in checked.overlaps(HOME)] == ["panda_hand vs can"]
    assert checked.overlaps(HOME, carried="can") == [] and checked.is_free(HOME, carried="can")
    overlaps = checked.overlaps(HOME, carried="can", moved_W=(0.0, 0.0, 0.15))
    assert overlaps and not checked.is_free(HOME, carried="can", moved_W=(0.0, 0.0, 0.15))
    assert {(o.link, o.other) for o in overlaps} == {("panda_link7", "can"), ("panda_link6", "can")}
    assert not checked.is_free(HOME)


@pytest.mark.parametrize("moved", [(0.0, 0.0, 0.3), (-0.08, 0.05, 0.07)])
def test_moved_is_as_if_placed_there(station: Station, moved: tuple[float, float, float]) -> None:
    """Two tilted boxes; one is carried, against a diagram in which free ones stand there."""
    tilt, (x, y, z) = (20.0, -30.0, 50.0), moved
    before = (0.35 - x, 0.1 - y, 0.45 - z)
    low, high = (scene_pose(station, p, tilt) for p in (before, (0.35, 0.1, 0.45)))
    other = Instance(name="other", object="box", X_SO=scene_pose(station, (0.4, -0.2, 0.4), tilt))
    checked = collision(station, Instance(name="box", object="box", X_SO=low), other)
    scene = Scene(
        SceneDocument(
            name="higher",
            library="household",
            instances=(Instance(name="box", object="box", X_SO=high), other),
        ),
        load_scene("tabletop_six").library,
        Path("higher.yaml"),
    )
    oracle = ArmCollision(build_station_diagram(scene, station))
    hand = ("panda_hand", "panda_leftfinger", "panda_rightfinger")
    rng, seen = np.random.default_rng(3), set[tuple[bool, bool]]()
    for q in HOME + rng.uniform(-0.8, 0.8, (100, 7)):
        every = {(o.link, o.other) for o in oracle.overlaps(q)}
        counted = {(link, other) for link, other in every if other != "box" or link not in hand}
        overlaps = checked.overlaps(q, carried="box", moved_W=moved)
        assert {(o.link, o.other) for o in overlaps} == counted
        assert checked.is_free(q, carried="box", moved_W=moved) is (not counted)
        seen.add((bool(every), bool(counted)))
    assert seen == {(False, False), (True, False), (True, True)}


@pytest.mark.parametrize("carried", [None, "mug"])
def test_clones_answer_as_drakes_own_checker_does(station: Station, carried: str | None) -> None:
    """Also where an object stands in the arm's base, and a post, which cannot be seen, does."""
    in_base = Instance(name="base", object="can", X_SO=scene_pose(station, (0.0, 0.0, 0.05)))
    post = Obstacle(X_WB=Pose((-0.1, 0.0, 0.03)), size=(0.04, 0.04, 0.06))
    mug = Instance(name="mug", object="mug", X_SO=scene_pose(station, (0.4, 0.0, 0.4)))
    rng = np.random.default_rng(9)
    for instances in ((mug,), (mug, in_base)):
        checked = collision(station, *instances, post=post)
        plain = checked.checker.Clone()
        if carried:
            filtered = plain.GetFilteredCollisionMatrix().copy()
            plant = plain.plant()
            (held,) = plant.GetBodyIndices(plant.GetModelInstanceByName(carried))
            for body in plant.GetBodyIndices(plant.GetModelInstanceByName("hand")):
                filtered[int(held), int(body)] = filtered[int(body), int(held)] = 1
            plain.SetCollisionFilterMatrix(filtered)
        rise = 0.1 if carried else 0.0
        free = []
        for q in HOME + rng.uniform(-0.9, 0.9, (100, 7)):
            configuration = checked.configuration(q, carried, rise)
            free.append(plain.CheckConfigCollisionFree(configuration))
            assert checked.is_free(q, carried=carried, moved_W=(0.0, 0.0, rise)) is free[-1]
        assert (10 < sum(free) < 90) if instances == (mug,) else not any(free)


def test_what_is_carried_does_not_count_against_the_scene(station: Station) -> None:
    """A can that is sunk into the table, and into a mug and a roof once it is lifted."""
    can = Instance(name="can", object="can", X_SO=scene_pose(station, (0.4, 0.2, -0.02)))
    mug = Instance(name="mug", object="mug", X_SO=scene_pose(station, (0.42, 0.2, 0.0)))
    roof = Obstacle(X_WB=Pose((0.4, 0.2, 0.3)), size=(0.1, 0.1, 0.02))
    checked = collision(station, can, mug, roof=roof)
    for rise in (0.0, 0.2, 0.3):
        assert checked.is_free(HOME, carried="can", moved_W=(0.0, 0.0, rise))
        assert checked.overlaps(HOME, carried="can", moved_W=(0.0, 0.0, rise)) == []


def test_nothing_remains_of_what_was_carried(station: Station) -> None:
    x, y, z = HAND
    can = Instance(name="can", object="can", X_SO=scene_pose(station, (x, y, z - 0.1)))
    checked, fresh = collision(station, can), collision(station, can)
    for q in HOME + np.random.default_rng(5).uniform(-0.5, 0.5, (20, 7)):
        checked.is_free(q, carried="can", moved_W=(0.1, -0.05, 0.2))
        assert checked.is_free(q) is fresh.is_free(q)
        assert checked.overlaps(q) == fresh.overlaps(q)


def test_what_cannot_be_carried(station: Station) -> None:
    can = Instance(name="can", object="can", X_SO=Pose((0.3, 0.2, 0.0)))
    checked = collision(station, can)
    with pytest.raises(
        UnknownNameError, match=r"'cam' is not an instance that can be carried.*'can'"
    ):
        checked.is_free(HOME, carried="cam")
    with pytest.raises(InvalidInputError, match=r"moved_W is \[0\.0, 0\.0, 0\.1\] m"):
        checked.overlaps(HOME, moved_W=(0.0, 0.0, 0.1))


def test_an_arm_is_needed(station: Station) -> None:
    hand = build_station_diagram(load_scene("tabletop_six"), station, robot="hand")
    with pytest.raises(InvalidInputError, match="built with robot='hand'; build it with 'arm'"):
        ArmCollision(hand)
