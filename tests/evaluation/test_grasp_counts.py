"""Counts of clear and reachable grasps: against `reach`, Drake's own query, and known scenes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from burg_drake.core import GraspSet, InvalidInputError, Pose, UnknownNameError
from burg_drake.evaluation import (
    ARM_LIMITS,
    GraspCount,
    ReachJudgeFactory,
    count_grasps,
    given_candidates,
    grasp_counts,
    object_grasps,
)
from burg_drake.grasping import HandClearance
from burg_drake.scene import Scene
from burg_drake.station import Obstacle, Station, build_station_diagram, load_station
from tests.evaluation.composed import composed

N = 12
MUG = ("mug", "mug", 0.3, 0.21, 90.0)
ALONE = composed(MUG)
BETWEEN = composed(MUG, ("left", "box", 0.226, 0.21, 0.0), ("right", "box", 0.374, 0.21, 0.0))


@pytest.fixture(scope="module")
def panda() -> Station:
    return load_station("panda_tabletop")


@pytest.fixture(scope="module")
def told(panda: Station) -> list[tuple[str, GraspCount]]:
    """Of the mug and the left box, as they come."""
    return list(grasp_counts(BETWEEN, panda, ["left", "mug"], grasps_per_object=N))


@pytest.fixture(scope="module")
def between(told: list[tuple[str, GraspCount]]) -> dict[str, GraspCount]:
    return dict(told)


def X_WO(scene: Scene, station: Station, name: str) -> np.ndarray:
    return station.document.X_WS.matrix() @ scene.X_SO(name)


def test_a_mug_between_two_boxes(between: dict[str, GraspCount], panda: Station) -> None:
    """Alone nearly all of its grasps are reached; between the boxes few, and they are named."""
    alone = count_grasps(ALONE, panda, grasps_per_object=N)["mug"]
    assert alone.sampled == alone.clear == N
    assert alone.reachable is not None
    assert alone.reachable > 0.8 * N
    mug = between["mug"]
    assert mug.clear < 0.5 * N
    assert {"left", "right"} == set(list(mug.in_the_way)[:2])
    assert list(mug.in_the_way.values()) == sorted(mug.in_the_way.values(), reverse=True)
    assert "table" not in mug.in_the_way


def test_every_grasp_counts_once(between: dict[str, GraspCount]) -> None:
    assert list(between) == ["left", "mug"]
    for count in between.values():
        assert count.reachable is not None
        assert 0 <= count.reachable <= count.clear <= count.sampled == N
        assert sum(count.in_the_way.values()) == count.sampled - count.reachable
        assert count.good == count.reachable
        assert not count.note


def test_the_hand_is_told_first(told: list[tuple[str, GraspCount]]) -> None:
    """In the order that was asked for, then all again with what the arm says."""
    assert [name for name, _ in told] == ["left", "mug", "left", "mug"]
    for (_, hand), (_, arm) in zip(told[:2], told[2:], strict=True):
        assert (hand.sampled, hand.clear, hand.reachable) == (arm.sampled, arm.clear, None)
        assert sum(hand.in_the_way.values()) == hand.sampled - hand.clear


def test_clear_grasps_by_drakes_own_query(between: dict[str, GraspCount], panda: Station) -> None:
    hand = HandClearance(build_station_diagram(BETWEEN, panda, robot="hand"))
    for name, count in between.items():
        pose = X_WO(BETWEEN, panda, name)
        grasps = object_grasps(BETWEEN.library, BETWEEN.instance(name).object, pose, panda, N)
        hit = [hand.touched(pose @ X_OG) for X_OG in grasps.X_OG]
        assert count.clear == sum(not touched for touched in hit)


def test_the_same_verdicts_as_reach(between: dict[str, GraspCount], panda: Station) -> None:
    """Asked for by the judge of `reach`."""
    some = object_grasps(BETWEEN.library, "mug", X_WO(BETWEEN, panda, "mug"), panda, N)
    given = {"mug": GraspSet.create(some.X_OG, object="mug", width=some.width)}
    left = list(given_candidates(BETWEEN, given))
    counts = [len(left)]
    for screen in ReachJudgeFactory(BETWEEN, panda, panda.document.motion)().screens:
        decisions = screen.ask(left)
        left = [one for one, said in zip(left, decisions, strict=True) if said.outcome is None]
        counts.append(len(left))
    mug = between["mug"]
    assert counts == [mug.sampled, mug.clear, mug.reachable]


def test_grasps_do_not_depend_on_place(panda: Station) -> None:
    """Moved, turned about the vertical, or settled by a hair: the same grasps; tipped over: others,
    and none of them from below."""
    library = ALONE.library
    first = object_grasps(library, "mug", X_WO(ALONE, panda, "mug"), panda, N)
    for x, yaw, roll in ((0.1, 20.0, 0.0), (0.4, -130.0, 0.004)):
        moved = Pose((x, 0.3, 0.00004), rpy_deg=(roll, 0.0, yaw)).matrix()
        again = object_grasps(library, "mug", moved, panda, N)
        np.testing.assert_array_equal(again.X_OG, first.X_OG)
    tipped = Pose((0.3, 0.2, 0.0405), rpy_deg=(90.0, 0.0, 0.0)).matrix()
    lying = object_grasps(library, "mug", tipped, panda, N)
    assert not np.array_equal(lying.X_OG, first.X_OG)
    assert ((tipped @ lying.X_OG)[:, 2, 2] < 0.0).all()


@pytest.mark.thorough
def test_the_arm_and_obstacles_are_named(panda: Station) -> None:
    """A mug at the arm's foot is out of its reach; beside a wall of the station, that is named."""
    arm = panda.document.arm
    assert arm is not None
    far = replace(arm, X_WA=Pose((-0.6, 0.0, 0.0)))
    station = replace(panda, document=replace(panda.document, arm=far))
    count = count_grasps(ALONE, station, grasps_per_object=8)["mug"]
    assert (count.clear, count.reachable, count.in_the_way) == (8, 0, {ARM_LIMITS: 8})
    p_W = X_WO(ALONE, panda, "mug")[:3, 3]
    box = Obstacle(X_WB=Pose((p_W[0], p_W[1], 0.15)), size=(0.3, 0.3, 0.1))
    roofed = replace(panda, document=replace(panda.document, background={"roof": box}))
    count = count_grasps(ALONE, roofed, grasps_per_object=8, reach=False)["mug"]
    assert count.in_the_way == {"roof": 8}
    assert count.reachable is None
    assert count.good == 0


def test_an_object_that_the_hand_does_not_take_says_why(panda: Station) -> None:
    """A box of 158 x 210 mm that lies flat: the hand opens by 80 mm."""
    flat = Pose((0.3, 0.2, 0.03), rpy_deg=(0.0, 90.0, 0.0))
    lying = replace(ALONE.document.instances[0], name="box", object="box", X_SO=flat)
    scene = replace(ALONE, document=replace(ALONE.document, instances=(lying,)))
    count = count_grasps(scene, panda, grasps_per_object=2, reach=False)["box"]
    assert count.sampled < 2
    assert count.note.startswith(f"box: only {count.sampled} of 2 grasps were found: of ")


def test_only_some_and_none(panda: Station) -> None:
    assert list(count_grasps(BETWEEN, panda, only=["box"], grasps_per_object=4, reach=False)) == [
        "left",
        "right",
    ]
    assert count_grasps(composed(), panda) == {}
    wsg = load_station("wsg_tabletop")
    assert count_grasps(ALONE, wsg, grasps_per_object=4)["mug"].reachable is None


def test_what_is_refused(panda: Station) -> None:
    with pytest.raises(InvalidInputError, match="grasps per object is 0; give 1 or more"):
        count_grasps(ALONE, panda, grasps_per_object=0)
    with pytest.raises(UnknownNameError, match="'mugg'"):
        count_grasps(ALONE, panda, only=["mugg"])
