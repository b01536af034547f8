"""Ways from home: mazes of a gantry, which can be told by eye, and pregrasps of the Panda; ways are
audited by Drake in fine steps."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from gantry import HOME, LOWER, UPPER, box, gantry_edges

from burg_drake.core import grasp_from_axes
from burg_drake.motion import (
    ArmCollision,
    ArmKinematics,
    ArmProximity,
    EdgeChecker,
    HomeTree,
    PandaIk,
    postures_over_objects,
)
from burg_drake.scene import load_scene
from burg_drake.station import Obstacle, Station, build_station_diagram, load_station
from tests.thorough import thorough

GOALS = 8
"""Poses of the hand that are to be reached in each station."""
AUDIT = 0.01
"""Steps of the audit [m]."""
LEVERS = np.array([1.1, 1.1, 0.8, 0.8, 0.35, 0.35, 0.25])
"""More than the Panda, with its hand, reaches from each of its axes [m]."""

SHELF = {
    "back": box((0.70, -0.34, 0.0), (0.72, 0.34, 0.4)),
    "left": box((0.25, 0.32, 0.0), (0.70, 0.34, 0.4)),
    "right": box((0.25, -0.34, 0.0), (0.70, -0.32, 0.4)),
    "roof": box((0.45, -0.34, 0.4), (0.70, 0.34, 0.42)),
}


@dataclass(frozen=True)
class Panda:
    """The Panda in a scene, and postures to reach."""

    edges: EdgeChecker
    tree: HomeTree
    goals: list[np.ndarray]


def panda(background: dict[str, Obstacle]) -> Panda:
    station = load_station("panda_tabletop")
    station = replace(station, document=replace(station.document, background=background))
    scene = load_scene("tabletop_six")
    few = tuple(i for i in scene.document.instances if i.object in ("mug", "bottle", "bowl"))
    scene = replace(scene, document=replace(scene.document, instances=few))
    diagram = build_station_diagram(scene, station, weld_objects=True)
    edges = EdgeChecker(ArmProximity(diagram), ArmCollision(diagram))
    arm = station.document.arm
    assert arm is not None
    plant = diagram.plant
    kinematics = ArmKinematics.from_plant(
        plant,
        diagram.arm_joints,
        base=plant.GetFrameByName(arm.base, plant.GetModelInstanceByName("arm")),
        hand=plant.GetFrameByName(station.hand.body, plant.GetModelInstanceByName("hand")),
    )
    home, lower, upper = np.array(arm.home), kinematics.lower, kinematics.upper
    focus = postures_over_objects(diagram, edges.proximity.links, home, lower, upper)
    tree = HomeTree(edges, home, lower, upper, focus=focus)
    return Panda(edges, tree, pregrasps(station, edges, kinematics))


def pregrasps(station: Station, edges: EdgeChecker, kinematics: ArmKinematics) -> list[np.ndarray]:
    """Free postures of the hand over the board, 10 to 30 cm high, tilted by up to 45 degrees; up to
    four for each pose."""
    rng = np.random.default_rng(5)
    approach = np.column_stack([rng.uniform(-0.7, 0.7, (60, 2)), np.full(60, -1.0)])
    places = rng.uniform((0.3, -0.28, 0.1), (0.65, 0.28, 0.3), (60, 3))
    X_WG = grasp_from_axes(rng.normal(size=(60, 3)), approach, places)
    ik = PandaIk.of(kinematics)
    assert ik is not None
    goals = []
    for X in X_WG:
        q = ik.solve(station.hand.X_AH(X)[None], np.linspace(-2.8, 2.8, 12)).q
        free = [row for row in rng.permutation(q) if edges.collision.is_free(row)][:4]
        if free:
            goals.append(np.array(free))
        if len(goals) == GOALS:
            break
    return goals


@pytest.fixture(scope="module")
def table() -> Panda:
    return panda({})


@pytest.fixture(scope="module", params=["table", thorough("shelf")])
def station_case(request: pytest.FixtureRequest, table: Panda) -> Panda:
    return table if request.param == "table" else panda(SHELF)


def audit(edges: EdgeChecker, path: np.ndarray, levers: np.ndarray) -> bool:
    """Whether Drake finds all of a way free in steps of at most `AUDIT`."""
    for a, b in pairwise(path):
        rows = 2 + int((np.abs(b - a) * levers).sum() / AUDIT)
        if not all(edges.collision.is_free(q) for q in np.linspace(a, b, rows)):
            return False
    return True


def length(path: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def test_no_way_fails_an_audit(station_case: Panda) -> None:
    found = [station_case.tree.connect(goals) for goals in station_case.goals]
    assert len(found) >= 8
    assert sum(any(p is not None for p in paths) for paths in found) >= 0.9 * len(found)
    for goals, paths in list(zip(station_case.goals, found, strict=True))[:2]:
        for goal, path in zip(goals[:1], paths, strict=False):
            if path is None:
                continue
            assert np.array_equal(path[0], station_case.tree.roadmap.q[0])
            assert np.array_equal(path[-1], goal)
            assert audit(station_case.edges, path, LEVERS)


def test_answers_do_not_depend_on_what_was_asked_before(table: Panda) -> None:
    goals = np.array([some[0] for some in table.goals[:8]])
    other = panda({}).tree
    together = table.tree.connect(goals)
    for goal, path in list(zip(goals, together, strict=True))[::-1]:
        (alone,) = other.connect(goal[None])
        assert alone is not None and np.array_equal(alone, path)


@pytest.mark.thorough
def test_shortcuts_are_shorter_and_pass_the_audit(station_case: Panda) -> None:
    before = after = 0.0
    for goals in station_case.goals[6:7]:
        path = next((p for p in station_case.tree.connect(goals) if p is not None), None)
        if path is None:
            continue
        short = station_case.tree.shortcut(path)
        assert np.array_equal(short[[0, -1]], path[[0, -1]])
        scale = station_case.tree.roadmap.scale
        assert length(short * scale) <= length(path * scale)
        assert np.array_equal(short, station_case.tree.shortcut(path))
        assert audit(station_case.edges, short, LEVERS)
        before, after = before + length(path), after + length(short)
    assert after < 0.8 * before


def test_over_a_wall(tmp_path: Path) -> None:
    """The wall ends 10 cm below the highest place of the fingers."""
    edges = gantry_edges(tmp_path, wall=box((0.5, -0.6, 0.0), (0.52, 0.6, 0.65)))
    tree = HomeTree(edges, HOME, LOWER, UPPER)
    goal = np.array([0.8, 0.0, 0.3])
    (found,) = tree.connect(goal[None])
    assert found is not None and not edges.is_free(HOME, goal)
    for path in (found, tree.shortcut(found)):
        assert path[:, 2].max() > 0.65 and audit(edges, path, np.ones(3))


def test_a_joint_makes_no_detour_that_is_not_needed(tmp_path: Path) -> None:
    """Over the wall the gantry has to rise; it need not go to the side and back."""
    edges = gantry_edges(tmp_path, wall=box((0.5, -0.6, 0.0), (0.52, 0.6, 0.55)))
    tree = HomeTree(edges, HOME, LOWER, UPPER, nodes=0)
    ends = HOME, (HOME[0] + 0.6, 0.0, HOME[2])
    over = [(HOME[0] + 0.1, 0.49, 0.7), (HOME[0] + 0.5, 0.49, 0.7)]
    path = np.array([ends[0], *over, ends[1]])
    assert edges.first_blocked(path) is None
    short = tree.shortcut(path)
    assert edges.first_blocked(short) is None and length(short) < length(path)
    assert np.abs(short[:, 1]).max() < 0.25 and np.ptp(short[:, 2]) > 0.2


def test_out_of_a_narrow_shaft(tmp_path: Path) -> None:
    """A well, 30 cm wide along the closing direction and 14 cm across, that no node lies in."""
    inner, outer = ((0.63, -0.15), (0.77, 0.15)), ((0.6, -0.18), (0.8, 0.18))
    shaft = {
        "front": box((outer[0][0], outer[0][1], 0.0), (inner[0][0], outer[1][1], 0.6)),
        "back": box((inner[1][0], outer[0][1], 0.0), (outer[1][0], outer[1][1], 0.6)),
        "right": box((inner[0][0], outer[0][1], 0.0), (inner[1][0], inner[0][1], 0.6)),
        "left": box((inner[0][0], inner[1][1], 0.0), (inner[1][0], outer[1][1], 0.6)),
    }
    edges = gantry_edges(tmp_path, **shaft)
    tree = HomeTree(edges, HOME, LOWER, UPPER, nodes=30)
    goal = np.array([0.7, 0.0, 0.2])
    assert not any(edges.is_free(q, goal) for q in tree.roadmap.q)
    (path,) = tree.connect(goal[None])
    assert path is not None and audit(edges, path, np.ones(3))


def test_no_way_into_a_closed_box(tmp_path: Path) -> None:
    closed = {
        "front": box((0.55, -0.25, 0.0), (0.57, 0.25, 0.7)),
        "back": box((0.88, -0.25, 0.0), (0.9, 0.25, 0.7)),
        "right": box((0.57, -0.25, 0.0), (0.88, -0.23, 0.7)),
        "left": box((0.57, 0.23, 0.0), (0.88, 0.25, 0.7)),
        "top": box((0.55, -0.25, 0.7), (0.9, 0.25, 0.72)),
    }
    edges = gantry_edges(tmp_path, **closed)
    tree = HomeTree(edges, HOME, LOWER, UPPER)
    inside, outside, blocked = [0.73, 0.0, 0.3], [0.3, 0.3, 0.5], [0.56, 0.0, 0.3]
    assert edges.collision.is_free(np.array(inside))
    into_box, into_wall, past_it = tree.connect(np.array([inside, blocked, outside]))
    assert into_box is None and into_wall is None
    assert past_it is not None


def test_home_alone(tmp_path: Path) -> None:
    """A roadmap without a node beside home leads as far as straight segments do."""
    tree = HomeTree(gantry_edges(tmp_path), HOME, LOWER, UPPER, nodes=0)
    straight, nowhere = tree.connect(HOME + np.array([[0.3, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    assert straight is not None and len(straight) == 2
    assert nowhere is not None and np.array_equal(nowhere, [HOME, HOME])
