"""Trials judged by statics: forces, patches and limits of friction in closed form.

Pads are elastic foundations: a layer of thickness h and modulus E yields to a pressure p by
p h / E. A finger presses with N, and both pads together hold 2 mu N.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from trial_world import (
    BOX,
    BOX_MASS,
    CENTRE,
    FORCE,
    GRAVITY,
    PAD,
    SLOW,
    from_above,
    lifting,
    make_station,
)

from burg_drake.core import Outcome, grasp_from_axes
from burg_drake.scene import Scene
from burg_drake.simulation import HandTrial, hand_trial_of
from burg_drake.station import ENGINES
from tests.thorough import thorough

STIFFNESS = 1e7 / 0.0076
"""Modulus of the pads over their thickness from the middle to the front [N/m^3]."""
PAD_OFFSET = 0.00025
"""The pads' middle is so far beyond the grasp frame [m]."""
COULOMB_FRICTION = BOX_MASS * GRAVITY / (2 * FORCE)
"""With this coefficient the pads just carry the box."""
COULOMB_MASS = 2 * FORCE * 0.08 / GRAVITY
"""With a coefficient of 0.08 the pads just carry this [kg]."""

BAR_MASS, BAR_LENGTH = 0.2, 0.30
STEEP_LIFT = 0.02
STEEP = lifting(STEEP_LIFT, 1.4, hold_time=0.1)
"""Raises the hand by 20 mm, also at 0.04 m/s^2."""


@pytest.fixture(scope="module")
def slow_trials(make_scene: Callable[..., Scene]) -> dict[str, HandTrial]:
    """The box, lifted slowly, by engine."""
    scene = make_scene(("box", 0.3, 0.2, 0.0))
    return {
        name: hand_trial_of(scene, make_station(), engine, settings=SLOW)
        for name, engine in ENGINES.items()
    }


# --- pad force and load -------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "height"), [("ball", 0.03), ("can", 0.08)])
def test_pads_press_round_objects_with_the_commanded_force(make_scene, name, height) -> None:
    trial = HandTrial(make_scene((name, 0.3, 0.2, 0.0)), make_station())
    result = trial.run(name, from_above(height))
    assert result.outcome is Outcome.LIFTED
    assert result.margins.pad_force == pytest.approx(FORCE, rel=0.01)


@pytest.mark.parametrize("tilt", [np.deg2rad(15.0), np.deg2rad(-15.0)])
def test_the_weaker_pad_presses_less_by_half_of_the_weight_along_the_closing_axis(
    make_scene: Callable[..., Scene], tilt: float
) -> None:
    """Along the axis the pads press with 2 N together, as one drive moves both fingers, and with
    m g sin(tilt) against each other. A ball is pressed in by the root of the force, and so is the
    area of its patch."""
    settings = replace(SLOW, hold_time=0.1)
    trial = HandTrial(make_scene(("ball", 0.3, 0.2, 0.0)), make_station(), settings=settings)
    c, s = np.cos(tilt), np.sin(tilt)
    tilted = grasp_from_axes((c, 0.0, -s), (-s, 0.0, -c), (0.0, 0.0, 0.03))
    light = trial.run("ball", tilted, friction=1.0, mass=0.01).margins
    heavy = trial.run("ball", tilted, friction=1.0, mass=1.5).margins
    weaker = FORCE - 1.5 * GRAVITY * abs(s) / 2.0
    assert light.pad_force == pytest.approx(FORCE, rel=0.01)
    assert heavy.pad_force == pytest.approx(weaker, rel=0.01)
    assert heavy.patch_area / light.patch_area == pytest.approx((weaker / FORCE) ** 0.5, rel=0.01)


def test_pads_carry_the_weight_and_press_against_each_other(slow_trials) -> None:
    """Held at rest: both forces on the box and its weight are in equilibrium."""
    execution = slow_trials["standard"].begin("box", box_grasp(slow_trials["standard"]))
    assert [execution.close(), execution.lift()] == [None, Outcome.LIFTED]
    left, right = execution.contact.force
    assert left[2] + right[2] == pytest.approx(BOX_MASS * GRAVITY, rel=0.01)
    assert left[:2] + right[:2] == pytest.approx(np.zeros(2), abs=0.01 * FORCE)


@pytest.mark.parametrize("friction", [0.005, 0.02])
def test_pads_that_slide_pull_with_coulombs_force(slow_trials, friction: float) -> None:
    """The box stays on the table, and the hand rises past it at a steady speed."""
    trial = slow_trials["standard"]
    execution = trial.begin("box", box_grasp(trial), friction=friction)
    assert execution.close() is None
    trial.world.command("lift", np.array([0.0, 0.05]))
    pulls = []
    for _ in range(20):
        execution.advance()
        pulls.append(execution.contact.force[:, 2].sum())
    assert execution.distance_followed() == pytest.approx(0.0, abs=1e-4)
    assert np.mean(pulls[5:]) == pytest.approx(2 * friction * FORCE, rel=0.02)


def box_grasp(trial: HandTrial) -> np.ndarray:
    return trial.X_WG("box", CENTRE)


# --- payload ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("engine", "tolerance"),
    [
        thorough("reference", 0.02),
        ("standard", 0.01),
        ("mujoco", 0.01),
        thorough("screening", 0.01),
    ],
)
def test_smallest_friction_that_holds(slow_trials, engine: str, tolerance: float) -> None:
    """2 mu N = m g, with the commanded force."""
    lost, held = (
        slow_trials[engine].run("box", CENTRE, friction=share * COULOMB_FRICTION)
        for share in (1.0 - tolerance, 1.0 + tolerance)
    )
    assert not lost.outcome.held and held.outcome is Outcome.LIFTED
    assert held.margins.pad_force == pytest.approx(FORCE, rel=0.01)


@pytest.mark.parametrize("engine", ["standard", "mujoco", thorough("screening")])
def test_largest_mass_that_is_held(slow_trials, engine: str) -> None:
    """2 mu N = m g."""
    lost, held = (
        slow_trials[engine].run("box", CENTRE, friction=0.08, mass=COULOMB_MASS / share)
        for share in (0.99, 1.01)
    )
    assert not lost.outcome.held and held.outcome.held


def press_and_rub(name: str) -> tuple[float, float]:
    """What the pressure of a round object adds up to along the closing direction, and in all, over
    a modulus of 1: of a strip of a pad's length, or of a disc."""
    radius, length = {"ball": (0.03, 0.0), "can": (0.03, PAD[1]), "wire": (0.002, PAD[1])}[name]
    angle = np.linspace(0.0, np.pi / 2, 20001)
    width = 2 * radius * length if length else 2 * np.pi * radius**2 * np.sin(angle)
    step, cosine = angle[1], np.cos(angle)

    def pressed(depth: float) -> np.ndarray:
        return STIFFNESS * np.maximum(depth - radius * (1.0 - cosine), 0.0) * width * step

    depth = brentq(lambda d: float((pressed(d) * cosine).sum()) - FORCE, 1e-6, radius)
    return float((pressed(depth) * cosine).sum()), float(pressed(depth).sum())


@pytest.mark.parametrize(
    ("name", "mass", "height", "tolerance"),
    [
        ("ball", 0.1, 0.03, 0.03),
        thorough("can", 0.2, 0.07, 0.03),
        ("wire", 0.3, 0.065, 0.08),
        ("card", 0.3, 0.045, 0.03),
    ],
)
def test_smallest_friction_that_holds_points_lines_and_walls(
    make_scene: Callable[..., Scene], name: str, mass: float, height: float, tolerance: float
) -> None:
    """Coulomb's limit. Pads press on round objects from more than one side, on a wire by 8 % more
    than on a card; its facets are coarse."""
    trial = HandTrial(make_scene((name, 0.3, 0.2, 0.0)), make_station(), settings=SLOW)
    along, whole = (1.0, 1.0) if name == "card" else press_and_rub(name)
    limit = mass * GRAVITY / (2 * FORCE) * along / whole
    lost, held = (
        trial.run(name, from_above(height), friction=share * limit)
        for share in (1.0 - tolerance, 1.0 + tolerance)
    )
    assert lost.margins.slip > 0.001 > held.margins.slip
    assert held.outcome is Outcome.LIFTED
    assert held.margins.pad_force == pytest.approx(FORCE, rel=0.01)


# --- torsion ------------------------------------------------------------------------------------


def limit_friction(width: float, length: float, lever: float) -> float:
    """Smallest coefficient with which a patch of even pressure and unit normal force carries a
    unit force at a lever [m], by integration over the patch: at the limit it turns about a point
    beside its middle, and each spot rubs across the line to that point."""
    n = 200
    x, z = np.meshgrid(*(((np.arange(n) + 0.5) / n - 0.5) * size for size in (width, length)))

    def rubbing(centre: float) -> tuple[float, float]:
        """Force and moment about the middle of the patch that turns about x = -centre."""
        r = np.hypot(x + centre, z)
        force_x, force_z = -z / r, (x + centre) / r
        return float(force_z.mean()), float((x * force_z - z * force_x).mean())

    def excess(centre: float) -> float:
        force, moment = rubbing(centre)
        return moment - lever * force

    return 1.0 / rubbing(brentq(excess, 1e-6, 1.0))[0]


def test_limit_of_torsion_has_known_special_cases() -> None:
    side = 0.018
    mean_distance = side * (np.sqrt(2) + np.log(1 + np.sqrt(2))) / 6  # from the square's middle
    assert limit_friction(side, side, 1.0) == pytest.approx(1.0 / mean_distance, rel=1e-3)
    assert limit_friction(side, side, 1e-4) == pytest.approx(1.0, rel=1e-3)
    # Howe and Cutkosky (1996) approximate the limit surface by an ellipsoid
    lever = 0.02
    ellipsoid = np.hypot(1.0, lever / mean_distance)
    assert limit_friction(side, side, lever) == pytest.approx(ellipsoid, rel=0.03)


@pytest.fixture(scope="module")
def bar_trials(make_scene: Callable[..., Scene]) -> dict[str, HandTrial]:
    """The bar, lifted slowly, by engine."""
    scene = make_scene(("bar", 0.3, 0.2, 0.0))
    return {
        name: hand_trial_of(scene, make_station(), engine, settings=STEEP)
        for name, engine in ENGINES.items()
    }


@pytest.mark.parametrize(
    ("engine", "tolerance", "mass", "lever"),
    [
        ("standard", 0.06, BAR_MASS, 0.05),
        thorough("standard", 0.06, 0.1, 0.05),
        ("standard", 0.06, 0.4, 0.02),
        thorough("standard", 0.06, 0.4, 0.05),
        thorough("mujoco", 0.06, BAR_MASS, 0.05),
        thorough("mujoco", 0.06, 0.4, 0.02),
        thorough("screening", 0.12, BAR_MASS, 0.05),
    ],
)
def test_smallest_friction_that_keeps_a_bar_level(
    bar_trials, engine: str, tolerance: float, mass: float, lever: float
) -> None:
    """By the weight alone, as the bar is lifted slowly. Of what is above 1, the triangles of the
    pads' fronts make 0.03, as they stand for the whole patch with their middles; the rest is creep,
    as Drake's friction is slightly viscous."""
    far_end = BAR_LENGTH / 2 + lever  # stays on the table while the bar turns in the hand
    limit = limit_friction(*PAD, lever) * mass * GRAVITY / (2 * FORCE)

    def tilt(share: float) -> float:
        X_OG, friction = from_above(0.02, y=lever), share * limit
        result = bar_trials[engine].run("bar", X_OG, friction=friction, mass=mass)
        return result.margins.tilt

    assert tilt(0.9) == pytest.approx(STEEP_LIFT / far_end, rel=0.05)
    assert tilt(1.0 - tolerance) > np.deg2rad(2.5) > tilt(1.0 + tolerance)
    assert tilt(1.3) < np.deg2rad(0.5)


# --- contact patches ----------------------------------------------------------------------------


def patch_area(trial: HandTrial, name: str, X_OG: np.ndarray) -> float:
    result = trial.run(name, X_OG)
    assert result.outcome is Outcome.LIFTED
    return result.margins.patch_area


@pytest.mark.parametrize("above_grasp", [0.03, 0.0, -0.004])
def test_patch_of_a_flat_face_is_the_overlap(box_trial: HandTrial, above_grasp: float) -> None:
    """Of the top face counts the strip that the box sinks in by."""
    width, length = PAD
    face = above_grasp + length / 2 + PAD_OFFSET
    expected = width * length
    if face < length:
        expected = width * face + FORCE / (STIFFNESS * face)
    area = patch_area(box_trial, "box", from_above(BOX[2] - above_grasp))
    assert area == pytest.approx(expected, rel=0.01)


def test_patch_of_a_ball_is_that_of_an_elastic_foundation(make_scene) -> None:
    """The ball sinks in by d: N = pi E/h R d^2 on a cap of 2 pi R d."""
    radius = 0.03
    depth = np.sqrt(FORCE / (np.pi * STIFFNESS * radius))
    trial = HandTrial(make_scene(("ball", 0.3, 0.2, 0.0)), make_station())
    area = patch_area(trial, "ball", from_above(radius))
    assert area == pytest.approx(2 * np.pi * radius * depth, rel=0.02)


def test_patch_of_a_can_is_that_of_an_elastic_foundation(make_scene) -> None:
    """Gripped across its axis, the can touches on a strip of half width b over the pad's length:
    N = 2/3 E/h b^3 L / R."""
    radius, length = 0.03, PAD[1]
    half_width = (1.5 * FORCE * radius / (STIFFNESS * length)) ** (1 / 3)
    assert half_width < PAD[0] / 2
    trial = HandTrial(make_scene(("can", 0.3, 0.2, 0.0)), make_station())
    area = patch_area(trial, "can", from_above(0.07))
    assert area == pytest.approx(2 * half_width * length, rel=0.05)
