"""Round things come to rest, as rolling resistance holds them: closed forms, and pairs that do not
settle without it."""

from __future__ import annotations

import importlib.util
import math
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydrake.multibody.math import SpatialVelocity
from pydrake.systems.analysis import Simulator
from trial_world import GRAVITY, make_station

from burg_drake.core import Pose
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.pipeline import ObjectSource, build_library
from burg_drake.scene import Board, Instance, Scene, SceneDocument
from burg_drake.simulation import (
    ROLLING_RESISTANCE,
    is_still,
    measure_drift,
    resist_rolling,
    settle_scene,
)
from burg_drake.station import Obstacle, build_station_diagram, load_station
from tools.household.curves import ellipse
from tools.household.solids import hulls, rings_along, tube, union

HOUSEHOLD = load_library("household")
SOURCE = Path(__file__).resolve().parents[2] / "benchmarks" / "settling.py"
SPEC = importlib.util.spec_from_file_location("settling_benchmark", SOURCE)
assert SPEC is not None and SPEC.loader is not None
BENCHMARK = importlib.util.module_from_spec(SPEC)
sys.modules[SPEC.name] = BENCHMARK
SPEC.loader.exec_module(BENCHMARK)
OTHER_PAIRS = [p for p in BENCHMARK.PAIRS if p not in ("marble in a mug", "ring over a peg")]
"""Of the benchmark; those two have tests of their own."""
RADIUS = 0.015
"""Of the marble [m]."""
ROLLING_MASS = 1.4
"""A solid ball that rolls is as hard to speed up as this many times its mass."""


def pair(*instances: Instance, library: ObjectLibrary = HOUSEHOLD) -> Scene:
    document = SceneDocument(
        name="pair", library=str(library.root), board=Board(size=(0.6, 0.4)), instances=instances
    )
    return Scene(document, library, Path("pair.yaml"))


def rolled_distance(slope: float, speed: float, duration: float) -> float:
    """How far the marble rolls [m] in a while [s] on a box that slopes down towards +x [rad]."""
    ramp = Obstacle(
        size=(0.4, 0.2, 0.02), X_WB=Pose((0.3, 0.2, 0.05), rpy_deg=(0, np.degrees(slope), 0))
    )
    X_WR = ramp.X_WB.matrix()
    start = X_WR[:3, 3] + 0.01 * X_WR[:3, 2]
    scene = pair(Instance(object="marble", X_SO=Pose(tuple(start))))
    station = make_station(obstacles={"ramp": ramp})
    built = build_station_diagram(scene, station, robot="none", engine="standard")
    simulator = Simulator(built.diagram)
    resist_rolling(built, simulator)
    context = built.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    body = built.plant.get_body(built.free["marble"])
    turning = SpatialVelocity([0.0, speed / RADIUS, 0.0], np.zeros(3))
    built.plant.SetFreeBodySpatialVelocity(context, body, turning)  # O is where it touches
    center = body.default_com()
    before = body.EvalPoseInWorld(context).multiply(center)
    simulator.AdvanceTo(duration)
    return float(np.linalg.norm((body.EvalPoseInWorld(context).multiply(center) - before)[:2]))


def test_a_ball_that_rolls_is_slowed_down() -> None:
    """By c g / 1.4, until it stands."""
    speed, slowing = 0.02, ROLLING_RESISTANCE * GRAVITY / ROLLING_MASS
    half = 0.5 * speed / slowing
    way = speed * half - slowing * half**2 / 2
    assert rolled_distance(0.0, speed, half) == pytest.approx(way, rel=0.03)
    assert rolled_distance(0.0, speed, 2.5 * half) == pytest.approx(
        speed**2 / slowing / 2, rel=0.03
    )


def test_a_ball_stays_on_slopes_up_to_the_coefficient() -> None:
    assert rolled_distance(0.8 * ROLLING_RESISTANCE, 0.0, 0.5) < 2e-5
    pull = ROLLING_RESISTANCE * GRAVITY / ROLLING_MASS  # of what is above the limit
    assert rolled_distance(2.0 * ROLLING_RESISTANCE, 0.0, 0.5) == pytest.approx(
        pull * 0.5**2 / 2, rel=0.05
    )


@pytest.mark.thorough  # `test_marble_in_mug` has it without settling a scene
def test_a_marble_in_a_mug_comes_to_rest() -> None:
    """On the inner floor, 6 mm high, within the wall, 36.5 mm from the axis."""
    scene = pair(
        Instance(object="mug", X_SO=Pose((0.3, 0.2, 0.0))),
        Instance(object="marble", X_SO=Pose((0.308, 0.197, 0.03))),
    )
    settled = settle_scene(scene, make_station())
    assert settled.at_rest
    x, y, z, _ = settled.scene.X_SO("marble") @ (0.0, 0.0, RADIUS, 1.0)
    assert z == pytest.approx(0.006 + RADIUS, abs=3e-4)
    assert math.hypot(x - 0.3, y - 0.2) < 0.0365 - RADIUS + 3e-4
    assert is_still(measure_drift(settled.scene, make_station(), duration=0.3))


@pytest.mark.thorough  # `test_drift` has what rocks until it rests
def test_a_ring_over_a_peg_comes_to_rest(tmp_path: Path) -> None:
    """In long steps, the peg's foot of few faces starts to rock by itself, ever farther."""
    base = trimesh.creation.box((0.08, 0.08, 0.012))
    base.apply_translation((0.0, 0.0, 0.006))
    pin = trimesh.creation.cylinder(radius=0.008, height=0.09, sections=32)
    pin.apply_translation((0.0, 0.0, 0.045))
    white = (1.0, 1.0, 1.0, 1.0)
    peg = union((base, white), (pin, white))
    turn = 2.0 * np.pi * np.arange(48) / 48
    path = 0.025 * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1) + (0.0, 0.0, 0.006)
    rings = rings_along(path, (0, 0, 1), ellipse(0.006, 0.006, 12), closed=True)
    pieces = hulls(np.concatenate([rings, rings[:1]]), range(0, 49, 2))
    sources = [
        ObjectSource(name="peg", mesh=peg, mass=0.15, pieces=(base, pin)),
        ObjectSource(name="ring", mesh=tube(rings, closed=True), mass=0.03, pieces=pieces),
    ]
    assert not build_library(sources, tmp_path, confirm=False).failed
    scene = pair(
        Instance(object="peg", X_SO=Pose((0.3, 0.2, 0.0))),
        Instance(object="ring", X_SO=Pose((0.302, 0.2, 0.06))),
        library=load_library(str(tmp_path)),
    )
    settled = settle_scene(scene, load_station("panda_tabletop"))
    assert settled.at_rest
    for name, height in (("peg", 0.0), ("ring", 0.012)):
        X_SO = settled.scene.X_SO(name)
        assert X_SO[2, 3] == pytest.approx(height, abs=1e-4)
        assert X_SO[2, 2] > math.cos(math.radians(0.05))


@pytest.fixture(scope="module")
def pairs_library(tmp_path_factory: pytest.TempPathFactory) -> ObjectLibrary:
    folder = tmp_path_factory.mktemp("pairs")
    assert not build_library(BENCHMARK.pair_sources(), folder, confirm=False).failed
    return load_library(folder)


@pytest.mark.thorough
@pytest.mark.parametrize("name", OTHER_PAIRS)
def test_the_other_pairs_of_the_benchmark_come_to_rest(
    name: str, pairs_library: ObjectLibrary
) -> None:
    scene = pair(*BENCHMARK.PAIRS[name], library=pairs_library)
    settled = settle_scene(scene, load_station("panda_tabletop"))
    assert settled.at_rest, settled.moving
