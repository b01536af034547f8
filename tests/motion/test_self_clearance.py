"""Which links are compared with which, and tables of their distances against Drake's."""

from __future__ import annotations

import itertools
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array
from burg_drake.motion import (
    ArmCollision,
    ArmShape,
    BallTrees,
    BodyBalls,
    JointGrid,
    LinkDistance,
    PairTable,
    collision_pairs,
    may_collide,
)
from burg_drake.scene import load_scene
from burg_drake.station import StationDiagram, build_station_diagram, load_station
from tests.motion.gantry import gantry_diagram
from tests.thorough import thorough


@cache
def diagram(station: str) -> StationDiagram:
    return build_station_diagram(
        load_scene("tabletop_six"), load_station(station), robot="arm", weld_objects=True
    )


def names(built: StationDiagram, trees: BallTrees) -> list[str]:
    return [built.plant.get_body(body.body).name() for body in trees.bodies]


def test_pairs_are_those_of_drakes_checker() -> None:
    built = diagram("panda_tabletop")
    inspector = built.scene_graph.model_inspector()
    found = {frozenset(p) for p in collision_pairs(built.plant, inspector, built.robot_bodies)}
    checker = ArmCollision(built).checker
    expected = {
        frozenset((a, b))
        for a, b in itertools.combinations(built.robot_bodies, 2)
        if not checker.IsCollisionFilteredBetween(a, b)
    }
    assert found == expected


@pytest.mark.thorough
def test_only_pairs_that_cannot_meet_are_left_out() -> None:
    """Of those left out, Drake finds no overlap at 1500 configurations; others in tables meet."""
    built = diagram("panda_tabletop")
    shape = ArmShape.of(built)
    known = names(built, shape.trees)
    counted = {
        frozenset(built.plant.get_body(body).name() for body in pair)
        for pair in collision_pairs(
            built.plant, built.scene_graph.model_inspector(), [b.body for b in shape.trees.bodies]
        )
    }
    compared = {frozenset((known[i], known[j])) for i, j in shape.self_clearance.pairs}
    collision = ArmCollision(built)
    met = set()
    low, high = shape.limits.T
    for q in np.random.default_rng(0).uniform(low, high, (1500, 7)):
        if not collision.is_free(q):
            met |= {frozenset((o.link, o.other)) for o in collision.overlaps(q)}
    ((_, pairs),) = shape.self_clearance.tables
    tabled = {frozenset((known[i], known[j])) for i, j in pairs}
    assert frozenset(("panda_link5", "panda_hand")) in tabled & met
    assert met & counted <= compared | tabled
    for never in (("panda_link6", "panda_hand"), ("panda_link2", "panda_link4")):
        assert frozenset(never) in counted - compared


def oracle(built: StationDiagram, a: BodyIndex, b: BodyIndex, q: Array) -> Array:
    """Drake's signed distances in the whole diagram."""
    context = built.diagram.CreateDefaultContext()
    plant_context = built.plant.GetMyContextFromRoot(context)
    positions = built.plant.GetPositions(plant_context)
    of_body = [
        built.plant.GetCollisionGeometriesForBody(built.plant.get_body(body)) for body in (a, b)
    ]
    distances = []
    for x in q:
        positions[[joint.position_start() for joint in built.arm_joints]] = x
        built.plant.SetPositions(plant_context, positions)
        query = built.scene_graph.get_query_output_port().Eval(
            built.scene_graph.GetMyContextFromRoot(context)
        )
        pairs = itertools.product(*of_body)
        distances.append(
            min(query.ComputeSignedDistancePairClosestPoints(*pair).distance for pair in pairs)
        )
    return np.array(distances)


def pair(
    built: StationDiagram, shape: ArmShape, first: str, second: str
) -> tuple[BodyBalls, BodyBalls, JointGrid, LinkDistance]:
    known = names(built, shape.trees)
    a, b = (shape.trees.bodies[known.index(name)] for name in (first, second))
    grid = JointGrid.over(shape.links, a, [b], shape.limits)
    assert grid is not None
    return a, b, grid, LinkDistance(built, shape.links, a.body, [b.body])


@pytest.mark.parametrize(
    ("station", "first", "second"),
    [
        ("panda_tabletop", "panda_link5", "panda_hand"),
        thorough("ur5e_tabletop", "shoulder_link", "forearm_link"),
        ("gantry", "x_link", "panda_hand"),
    ],
)
def test_tables_bound_distances(station: str, first: str, second: str, tmp_path: Path) -> None:
    """Two joints that turn within limits, or all around, or slide."""
    gantry = station == "gantry"
    built = gantry_diagram(tmp_path, blocks=("x_link", "z_link")) if gantry else diagram(station)
    shape = ArmShape.of(built)
    a, b, grid, distance = pair(built, shape, first, second)
    assert may_collide(grid, distance)
    table = PairTable.of(grid, distance)
    q = np.random.default_rng(1).uniform(*shape.limits.T, (3000, len(shape.limits)))
    lower, upper = table.bounds(q)
    drake = oracle(built, a.body, b.body, q[:300])
    assert np.all(lower[:300] <= np.maximum(drake, 0.0) + 1e-7)
    assert np.all(drake[upper[:300] < 0.0] < 0.0)
    assert distance.at(np.empty((0, len(grid.joints))), 1.0).shape == (0,)
    exact = distance.at(q[:, list(grid.joints)], 1.0)
    near = (exact > 0.0) & (exact < 0.02)
    assert near.sum() > 15
    assert np.all(lower[near] <= exact[near] + 1e-7)
    assert np.median((exact - lower)[near]) < 0.01
    deep = exact < -0.03  # boxes overlap by an unknown depth
    assert np.all(upper[deep] < 0.0)
    assert gantry or deep.sum() > 10
    alone = table.bounds(q[7:8])
    assert (alone[0][0], alone[1][0]) == (lower[7], upper[7])
    if station == "ur5e_tabletop":
        around, _ = table.bounds(q + 2.0 * np.pi * np.eye(6)[1])
        assert np.isclose(around, lower, atol=1e-6).mean() > 0.999  # rounding at a cell's edge


def test_distances_are_drakes_where_drakes_are_right() -> None:
    """Drake's search may end too early, so that it is never below ours; capsules are exact."""
    built = diagram("panda_tabletop")
    shape = ArmShape.of(built)
    for first, second in (("panda_link5", "panda_hand"), ("panda_link2", "panda_link4")):
        a, b, grid, distance = pair(built, shape, first, second)
        q = np.random.default_rng(4).uniform(*shape.limits.T, (300, 7))
        ours = distance.at(q[:, list(grid.joints)], 1.0)
        drake = oracle(built, a.body, b.body, q)
        apart = drake > 1e-5
        assert apart.sum() > 100
        np.testing.assert_array_equal(ours > 0.0, drake > 0.0)
        assert np.all(ours[apart] <= drake[apart] + 1e-6)
        assert np.mean(ours[apart] > drake[apart] - 5e-4) > 0.99


def test_a_table_holds_beyond_the_limits() -> None:
    built = diagram("panda_tabletop")
    shape = ArmShape.of(built)
    _a, _b, grid, distance = pair(built, shape, "panda_link5", "panda_hand")
    q = np.random.default_rng(2).uniform(*(1.3 * shape.limits.T), (1000, 7))
    lower, _ = PairTable.of(grid, distance).bounds(q)
    assert distance.at(np.empty((0, len(grid.joints))), 1.0).shape == (0,)
    exact = distance.at(q[:, list(grid.joints)], 1.0)
    apart = exact > 0.0
    assert apart.sum() > 300
    assert np.all(lower[apart] <= exact[apart] + 1e-7)


def test_links_that_stay_apart_never_meet() -> None:
    built = diagram("panda_tabletop")
    shape = ArmShape.of(built)
    a, b, grid, distance = pair(built, shape, "panda_link3", "panda_link5")
    assert not may_collide(grid, distance)
    q = np.random.default_rng(3).uniform(*shape.limits.T, (300, 7))
    assert oracle(built, a.body, b.body, q).min() > 0.0


def test_no_table_of_too_many_joints() -> None:
    shape = ArmShape.of(diagram("panda_tabletop"))
    known = names(diagram("panda_tabletop"), shape.trees)
    a, b = (shape.trees.bodies[known.index(name)] for name in ("panda_link4", "panda_hand"))
    assert JointGrid.over(shape.links, a, [b], shape.limits) is None
