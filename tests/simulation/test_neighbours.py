"""What a trial does to other objects, against statics, geometry and a rigid model of two boxes."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from trial_world import BOX, CENTRE, PILLAR, from_above, make_station

from burg_drake.core import Array, Outcome, Pose, grasp_from_axes
from burg_drake.scene import Instance, Scene
from burg_drake.simulation import HandTrial, MotionTracker, MujocoTrial, TrialResult, TrialSettings
from burg_drake.station import ENGINES, Engine, GraspMotion

MakeScene = Callable[..., Scene]
Trial = HandTrial | MujocoTrial

BLOCK = 0.05
"""Size of the block [m]."""
FINGER = 0.0476
"""Middle of the open finger from the middle of the hand [m]."""
TIP, NOSE = 0.0095, -0.037
"""Ends of the fingers and of the hand's body along the approach, in G [m]."""
HAND_WIDTH = 0.204
"""Extent of the hand's body along its closing axis [m]."""
LONG = GraspMotion(standoff=0.30)
"""Leaves room between the hand at the pregrasp and at the grasp for what is in neither."""
FRICTION = 0.24
"""Coefficient of the objects."""
TABLE_FRICTION = 2.0 * FRICTION * 0.5 / (FRICTION + 0.5)
"""Coefficient of objects on the table."""


@pytest.fixture(params=["standard", "mujoco"])
def engine(request: pytest.FixtureRequest) -> Engine:
    if request.param == "mujoco":
        pytest.importorskip("mujoco")
    return ENGINES[request.param]


def make_trial(scene: Scene, engine: Engine, *, lock: bool = True, **settings: object) -> Trial:
    kind = HandTrial if engine.simulator == "drake" else MujocoTrial
    return kind(scene, make_station(), engine=engine, settings=TrialSettings(**settings), lock=lock)


def level(z: float, y: float = 0.0) -> Array:
    """Grasp (4, 4) from -y at a height, closing along x."""
    return grasp_from_axes((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, y, z))


# --- an object that falls on another --------------------------------------------------------------

FALLING_BAR = {0.01: 9.8, 0.03: 3.7, 0.04: 2.4, 0.10: 0.5}
"""Motion of a cube [mm] that a falling bar meets, by its distance from the bar's foot [m]; the
rigid and inelastic model of `benchmarks/neighbours.py`."""


@pytest.mark.parametrize(("distance", "expected"), FALLING_BAR.items())
def test_a_bar_that_falls_moves_a_cube_as_far_as_in_a_rigid_model(
    make_scene: MakeScene, engine: Engine, distance: float, expected: float
) -> None:
    """The bar stands on its end, 8 degrees off the vertical."""
    tilt, foot = math.radians(8.0), 0.2 - BLOCK / 2 - distance
    middle = 0.15 * np.array([math.sin(tilt), math.cos(tilt)])  # of the bar's side, from its foot
    bar = Instance(
        object="bar", X_SO=Pose((0.3, foot + middle[0], middle[1]), rpy_deg=(82.0, 0.0, 0.0))
    )
    trial = make_trial(make_scene(("block", 0.3, 0.2, 0.0), bar), engine, lock=False)
    far = grasp_from_axes((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.9, 0.9, 0.9))
    world = trial.complete_world
    if isinstance(trial, HandTrial):
        trial.begin("bar", far)
    else:
        world.prepare("bar", far, None, np.array([0.0, 0.0, 1.0]), friction=None, mass=None)
    cube = world.free["block"]
    tracker = MotionTracker(world, [cube])
    for _ in range(120):
        world.advance(round(0.01 / engine.time_step))
        tracker.update(set())
    assert 1e3 * tracker.farthest[cube] == pytest.approx(expected, abs=1.5)


# --- toppled --------------------------------------------------------------------------------------


@pytest.mark.parametrize("topples", [False, True])
def test_a_pillar_topples_if_it_is_pushed_above_the_line_of_friction(
    make_scene: MakeScene, engine: Engine, topples: bool
) -> None:
    """A push at height h topples a body of width w that would slide otherwise, if
    h > w / (2 mu) + mu' w / 2, with mu at the table and mu' at the pushed face. The finger pushes
    with its whole height, so its lower edge decides."""
    half_finger, rear = 0.00875, 0.125
    line = PILLAR[0] / (2.0 * TABLE_FRICTION) + FRICTION * PILLAR[0] / 2.0
    scene = make_scene(("post", 0.3, 0.3, 0.0), ("pillar", 0.3 + FINGER, rear + 0.02, 0.0))
    # Slow, so that neither the blow nor the acceleration counts.
    trial = make_trial(
        scene, engine, approach=True, motion=GraspMotion(standoff=0.19), lift_time=4.0
    )
    height = line + (half_finger + 0.01 if topples else -0.01)
    result = trial.run("post", level(height))
    assert result.toppled == ("pillar" if topples else "")
    if topples:
        assert result.turned["pillar"] == pytest.approx(np.pi / 2.0, abs=0.1)
    else:
        assert result.pushed["pillar"] == pytest.approx(0.3 + TIP - rear, abs=0.001)
        assert result.turned["pillar"] < math.radians(1.0)


# --- lifted_disturbed -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("lift", "outcome"), [(0.009, Outcome.LIFTED), (0.011, Outcome.LIFTED_DISTURBED)]
)
def test_what_stands_on_the_target_moves_by_the_lift(
    make_scene: MakeScene, engine: Engine, lift: float, outcome: Outcome
) -> None:
    """A block in the middle of the box goes up with it, 1 mm less or more than the 10 mm that are
    allowed; one beside the box stays."""
    on_top = Instance(name="on_top", object="block", X_SO=Pose((0.3, 0.2, BOX[2])))
    scene = make_scene(("box", 0.3, 0.2, 0.0), on_top, ("block", 0.3, 0.2 + 0.0725, 0.0))
    result = make_trial(scene, engine).run("box", level(BOX[2] / 2, y=-0.01), lift=lift)
    assert result.displacements["on_top"] == pytest.approx(lift, abs=4e-4)
    assert result.displacements["block"] < 1e-4
    assert result.turned["on_top"] < math.radians(0.5)
    assert (result.outcome, result.toppled) == (outcome, "")


# --- the approach ---------------------------------------------------------------------------------


def test_the_approach_pushes_a_block_to_where_the_finger_ends(
    make_scene: MakeScene, engine: Engine
) -> None:
    rear = 0.03
    scene = make_scene(("post", 0.3, 0.2, 0.0), ("block", 0.3 + FINGER, rear + BLOCK / 2, 0.0))
    result = make_trial(scene, engine, approach=True, motion=LONG).run("post", level(0.04))
    assert result.pushed["block"] == pytest.approx(0.2 + TIP - rear, abs=0.002)
    assert result.outcome is Outcome.LIFTED_DISTURBED


@pytest.mark.parametrize(("gap", "touched"), [(0.001, False), (-0.001, True)])
def test_a_block_a_millimetre_beside_the_hand_is_not_touched(
    make_scene: MakeScene, engine: Engine, gap: float, touched: bool
) -> None:
    """The block stands where the hand is neither at the pregrasp nor at the grasp."""
    rear = -0.06
    assert 0.2 - LONG.standoff + NOSE < rear < rear + BLOCK < 0.2 - 0.1034 - 0.009
    x = 0.3 + HAND_WIDTH / 2 + gap + BLOCK / 2
    scene = make_scene(("post", 0.3, 0.2, 0.0), ("block", x, rear + BLOCK / 2, 0.0))
    result = make_trial(scene, engine, approach=True, motion=LONG).run("post", level(0.04))
    assert (result.pushed["block"] > 1e-4) is touched
    assert bool(result.touched) is touched
    if not touched:
        assert result.displacements["block"] == 0.0
        assert result.outcome is Outcome.LIFTED


# --- worlds of the target alone -------------------------------------------------------------------


def assert_as_complete(
    trial: Trial, target: str, X_OG: Array, monkeypatch: pytest.MonkeyPatch
) -> TrialResult:
    """Runs a trial that begins in the world of the target alone, if that is usable, and again in
    the complete world from the start: all that they return is the same."""
    found = trial.run(target, X_OG)
    assert trial.world is trial.complete_world
    monkeypatch.setattr(trial, "world_of", lambda instance: trial.complete_world)
    assert trial.run(target, X_OG) == found
    return found


def test_a_long_object_that_sweeps_a_neighbour(
    make_scene: MakeScene, engine: Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The hand carries the bar aside; its end, 0.12 m from the hand, takes a block along."""
    aside = GraspMotion(lift_height=0.2, lift_direction=(0.9, 0.0, 0.3))
    scene = make_scene(("bar", 0.2, 0.2, 0.0), ("block", 0.26, 0.32, 0.0), ("can", 0.5, 0.35, 0.0))
    trial = make_trial(scene, engine, motion=aside)
    assert trial.world_of("bar") is not trial.complete_world
    found = assert_as_complete(trial, "bar", from_above(0.028), monkeypatch)
    free = make_trial(scene, engine, lock=False, motion=aside).run("bar", from_above(0.028))
    assert found.outcome is free.outcome is Outcome.LIFTED_DISTURBED
    assert found.displacements["block"] == pytest.approx(free.displacements["block"], rel=0.15)
    assert found.displacements["block"] > 0.05
    assert found.displacements["can"] < 1e-3


def test_a_long_object_that_leans_on_the_target(
    make_scene: MakeScene, engine: Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bar lies on the upper edge of the box, at 20 degrees, where friction holds it; it turns
    about its foot as the box goes up."""
    angle, lift = math.radians(20.0), 0.03
    edge = 0.2 + BOX[1] / 2
    foot = edge + BOX[2] / math.tan(angle)
    p_SO = (0.3, foot - 0.15 * math.cos(angle), 0.15 * math.sin(angle))
    bar = Instance(object="bar", X_SO=Pose(p_SO, rpy_deg=(-math.degrees(angle), 0.0, 0.0)))
    trial = make_trial(
        make_scene(("box", 0.3, 0.2, 0.0), bar),
        engine,
        motion=GraspMotion(lift_height=lift),
    )
    assert trial.world_of("box") is trial.complete_world
    found = assert_as_complete(trial, "box", level(BOX[2] / 2, y=-0.01), monkeypatch)
    assert found.outcome is Outcome.LIFTED_DISTURBED
    turned = math.atan((BOX[2] + lift) * math.tan(angle) / BOX[2]) - angle
    assert found.turned["bar"] == pytest.approx(turned, rel=0.02)
    chord = 2.0 * math.hypot(0.30, 0.04) * math.sin(turned / 2.0)
    assert found.displacements["bar"] == pytest.approx(chord, abs=5e-4)


def test_a_trial_that_meets_nobody_keeps_its_world(make_scene: MakeScene, engine: Engine) -> None:
    """What may meet another object is compliant for it, and rigid for the pads as ever."""
    scene = make_scene(("box", 0.3, 0.2, 0.0), ("bar", 0.45, 0.2, 0.0))
    alone, complete = (
        make_trial(scene, engine, lock=lock).run("box", CENTRE, friction=0.3)
        for lock in (True, False)
    )
    assert alone.outcome is complete.outcome is Outcome.LIFTED
    for name in ("pad_force", "patch_area", "tilt"):
        one, other = getattr(alone.margins, name), getattr(complete.margins, name)
        assert one == pytest.approx(other, rel=1e-3, abs=1e-4), name
