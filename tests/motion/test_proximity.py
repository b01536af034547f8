"""Quick bounds on the arm's clearance against Drake's collision checker and dense sampling."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import InvalidInputError, Pose
from burg_drake.motion import ArmCollision, ArmProximity
from burg_drake.scene import Scene, SceneDocument, load_scene
from burg_drake.station import (
    Obstacle,
    Station,
    StationDiagram,
    build_station_diagram,
    load_station,
)
from tests.thorough import thorough

SHELF = {
    "back": Obstacle(X_WB=Pose((0.71, 0.0, 0.2)), size=(0.02, 0.68, 0.4)),
    "roof": Obstacle(X_WB=Pose((0.575, 0.0, 0.41), (0.0, 20.0, 0.0)), size=(0.25, 0.68, 0.02)),
}


def with_obstacles(background: dict[str, Obstacle]) -> Station:
    station = load_station("panda_tabletop")
    return replace(station, document=replace(station.document, background=background))


@cache
def diagram(name: str) -> StationDiagram:
    station = with_obstacles(SHELF) if name == "shelf" else load_station(name)
    return build_station_diagram(few_objects(), station, robot="arm", weld_objects=True)


def few_objects() -> Scene:
    """Mug, bottle and bowl of the six."""
    scene = load_scene("tabletop_six")
    few = tuple(i for i in scene.document.instances if i.object in ("mug", "bottle", "bowl"))
    return replace(scene, document=replace(scene.document, instances=few))


@cache
def judges(name: str) -> tuple[ArmProximity, ArmCollision]:
    return ArmProximity(diagram(name)), ArmCollision(diagram(name))


def limits(name: str) -> tuple[np.ndarray, np.ndarray]:
    joints = diagram(name).arm_joints
    return (
        np.array([joint.position_lower_limits()[0] for joint in joints]),
        np.array([joint.position_upper_limits()[0] for joint in joints]),
    )


def configurations(name: str, n: int, seed: int = 0) -> np.ndarray:
    """Half of them anywhere, half with the hand among the objects."""
    rng = np.random.default_rng(seed)
    low, high = limits(name)
    arm = diagram(name).station.document.arm
    assert arm is not None
    lowered = (0.0, 0.9, 0.0, 0.2, 0.0, 0.6, 0.0) if len(arm.home) == 7 else (0.0, 0.4) + (0.0,) * 4
    reaching = np.add(arm.home, lowered)
    near = reaching + rng.uniform(-0.6, 0.6, (n // 2, len(low)))
    return np.concatenate([rng.uniform(low, high, near.shape), np.clip(near, low, high)])


@pytest.mark.parametrize(
    "name", ["panda_tabletop", thorough("panda_offset"), "panda_wsg", "shelf", "ur5e_tabletop"]
)
def test_what_is_proven_is_what_drake_finds(name: str) -> None:
    """And little is left to ask Drake about."""
    proximity, collision = judges(name)
    q = configurations(name, 800)
    bounds = proximity.bounds(q)
    truth = np.array([collision.is_free(x) for x in q])
    assert not (bounds.free & ~truth).any()
    assert not (bounds.blocked & truth).any()
    assert np.all(bounds.lower <= bounds.upper)
    assert (bounds.likely_free != truth).mean() < 0.015
    assert (~bounds.free & ~bounds.blocked).mean() < 0.09
    assert min(truth.sum(), (~truth).sum()) > 50


@pytest.mark.parametrize("name", ["panda_tabletop", "shelf"])
def test_the_bounds_are_distances(name: str) -> None:
    """No lower bound is above Drake's distance to what stands still."""
    proximity, collision = judges(name)
    q = configurations(name, 50, seed=3)
    bounds = proximity.bounds(q)
    for x, lower, upper in zip(q, bounds.lower, bounds.upper, strict=True):
        clearance = collision.checker.CalcRobotClearance(collision.configuration(x), 0.3)
        distances = np.array(clearance.distances())
        scene = np.array(
            [b not in diagram(name).robot_bodies for b in clearance.other_indices()], dtype=bool
        )
        nearest = max(distances[scene].min(initial=np.inf), 0.0)
        assert lower <= nearest + 1e-9
        assert upper >= 0.0 or distances.min() < 0.0


def test_nothing_depends_on_the_batch() -> None:
    proximity, _ = judges("panda_tabletop")
    q = configurations("panda_tabletop", 5000, seed=1)
    together = proximity.bounds(q)
    way = proximity.displacement(q[:-1], q[1:])
    order = np.random.default_rng(2).permutation(len(q))
    shuffled = proximity.bounds(q[order])
    np.testing.assert_array_equal(shuffled.lower, together.lower[order])
    np.testing.assert_array_equal(shuffled.upper, together.upper[order])
    for i in (0, 1234, 4998):
        alone = proximity.bounds(q[i : i + 1])
        assert (alone.lower[0], alone.upper[0]) == (together.lower[i], together.upper[i])
        assert proximity.displacement(q[i : i + 1], q[i + 1 : i + 2])[0] == way[i]
    none = proximity.bounds(np.zeros((0, 7)))
    assert none.lower.shape == none.upper.shape == (0,)


def test_without_the_hand_only_the_arm_meets_the_scene() -> None:
    """A post through the fingers at home, another through the forearm."""
    home = np.array((0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4))
    posts = {
        "low": Obstacle(X_WB=Pose((0.30689, 0.0, 0.45)), size=(0.03, 0.3, 0.1)),
        "high": Obstacle(X_WB=Pose((0.2, 0.0, 0.69)), size=(0.02, 0.02, 0.3)),
    }
    library = load_scene("tabletop_six").library
    empty = Scene(SceneDocument(name="empty", library="household"), library, Path("empty.yaml"))
    for name, (whole, arm_alone) in {"low": (True, False), "high": (True, True)}.items():
        built = build_station_diagram(
            empty, with_obstacles({name: posts[name]}), robot="arm", weld_objects=True
        )
        proximity = ArmProximity(built)
        assert proximity.bounds(home[None]).blocked[0] == whole
        assert proximity.bounds(home[None], hand=False).blocked[0] == arm_alone
        assert proximity.bounds(home[None], hand=False).free[0] != arm_alone


def test_without_the_hand_the_hand_still_meets_the_arm() -> None:
    folded = np.array((0.0, 0.0, 0.0, -3.0, 0.0, 0.1, 0.0))
    proximity, collision = judges("panda_tabletop")
    assert not collision.is_free(folded)
    assert not proximity.bounds(folded[None], hand=False).free[0]


@pytest.mark.parametrize(("size", "loose"), [(0.02, 3.0), (0.3, 3.0), (1.5, 4.0)])
def test_no_point_of_the_robot_moves_farther(size: float, loose: float) -> None:
    """Corners of boxes around all collision geometry's middles, and the ends of the fingers, along
    paths sampled by Drake's kinematics."""
    built = diagram("panda_tabletop")
    proximity, _ = judges("panda_tabletop")
    rng = np.random.default_rng(5)
    low, high = limits("panda_tabletop")
    q_a = rng.uniform(low, high, (40, 7))
    q_b = np.clip(q_a + rng.uniform(-size, size, q_a.shape), low, high)
    bound = proximity.displacement(q_a, q_b)
    context = built.plant.CreateDefaultContext()
    indices = [joint.position_start() for joint in built.arm_joints]
    positions = built.plant.GetPositions(context)
    inspector = built.scene_graph.model_inspector()
    ratios = []
    for a, b, most in zip(q_a, q_b, bound, strict=True):
        tracks = []
        for t in np.linspace(0.0, 1.0, 25):
            positions[indices] = a + t * (b - a)
            built.plant.SetPositions(context, positions)
            places = []
            for index in built.robot_bodies:
                body = built.plant.get_body(index)
                X_WB = built.plant.EvalBodyPoseInWorld(context, body).GetAsMatrix4()
                for geometry in built.plant.GetCollisionGeometriesForBody(body):
                    p = inspector.GetPoseInFrame(geometry).translation()
                    places.append(X_WB[:3, :3] @ p + X_WB[:3, 3])
                if "finger" in body.name():
                    places.append(X_WB[:3, :3] @ (0.0, 0.0, 0.0545) + X_WB[:3, 3])
            tracks.append(places)
        moved = np.linalg.norm(np.diff(tracks, axis=0), axis=-1).sum(axis=0).max()
        assert moved <= most
        ratios.append(most / moved)
    assert np.median(ratios) < loose


def test_clearance_at_both_ends_proves_a_segment() -> None:
    proximity, collision = judges("panda_tabletop")
    q_a = configurations("panda_tabletop", 2000, seed=8)
    step = np.random.default_rng(9).uniform(-0.03, 0.03, q_a.shape)
    q_b = np.clip(q_a + step, *limits("panda_tabletop"))
    ends = proximity.bounds(q_a).lower + proximity.bounds(q_b).lower
    both = np.minimum(proximity.bounds(q_a).lower, proximity.bounds(q_b).lower) > 0.0
    proven = np.flatnonzero(both & (ends > proximity.displacement(q_a, q_b)))
    assert len(proven) > 50
    for i in proven[np.argsort(ends[proven])][:50]:
        for t in np.linspace(0.0, 1.0, 9):
            assert collision.is_free(q_a[i] + t * (q_b[i] - q_a[i]))


def test_an_arm_is_needed() -> None:
    hand = build_station_diagram(
        load_scene("tabletop_six"), load_station("panda_tabletop"), robot="hand"
    )
    with pytest.raises(InvalidInputError, match="built with robot='hand'; build it with 'arm'"):
        ArmProximity(hand)
