"""Trials of a shaken hand: inertial forces against kinematics, and grips against Coulomb's law."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from trial_world import BOX_MASS, FORCE, from_above, make_station

from burg_drake.core import (
    Array,
    InvalidInputError,
    Outcome,
    Pose,
    inverse,
    make_pose,
    swap_fingers,
)
from burg_drake.scene import Instance, Scene
from burg_drake.simulation import (
    NO_GRIP_LIMITS,
    BatchTrial,
    HandTrial,
    MujocoTrial,
    ShakeCarrier,
    ShakeSettings,
    TrialSettings,
    hand_trial_of,
)
from burg_drake.station import ENGINES

HEIGHT = 0.6
"""Of the origin of the shaken object [m]."""
ENGINES_TO_SHAKE = ("screening", "mujoco")


def in_the_air(
    object: str, rpy_deg: tuple[float, float, float] = (0.0, 0.0, 0.0), height: float = HEIGHT
) -> Instance:
    return Instance(object=object, X_SO=Pose((0.3, 0.2, height), rpy_deg=rpy_deg))


@pytest.fixture(scope="module")
def scene(make_scene: Callable[..., Scene]) -> Scene:
    return make_scene(in_the_air("box"))


def shaken(
    scene: Scene, engine: str, step: float | None = None, **settings: float
) -> HandTrial | MujocoTrial:
    asked = TrialSettings(shake=ShakeSettings(**settings), **NO_GRIP_LIMITS)
    used = ENGINES[engine]
    used = used if step is None else replace(used, time_step=step)
    return hand_trial_of(scene, make_station(), used, settings=asked)


# --- the forces -----------------------------------------------------------------------------------


def seen_from_the_hand(settings: ShakeSettings, share: float) -> Array:
    """Pose (4, 4) of a hand after a share of a period, in that at the start, from the definition of
    a stroke; for one period, and a closing axis that keeps its sense."""
    omega = 2.0 * np.pi * settings.shake_frequency
    stroke = (1.0 - np.cos(2.0 * np.pi * share)) / omega**2
    if share <= 1.0:
        return make_pose(p_AB=(0.0, 0.0, settings.shake_acceleration * stroke))
    turn = settings.turn_acceleration * stroke
    return make_pose(Rotation.from_rotvec((turn, 0.0, 0.0)).as_matrix())


UNTOUCHED = from_above(0.35, yaw=0.4)
"""A hand above the box, whose closing axis is cos(0.4) along the x axis of the box."""


@pytest.mark.parametrize("engine", ENGINES_TO_SHAKE)
def test_an_untouched_body_stays_where_it_is_while_the_hand_moves(
    scene: Scene, engine: str
) -> None:
    """Seen from the hand it moves as the hand does, the other way."""
    settings = ShakeSettings(shake_periods=1)
    trial = shaken(scene, engine, step=1e-4, shake_periods=1)
    world, X_WO = begin(trial, UNTOUCHED)
    body = world.free["box"]
    X_WG, carrier = world.X_WG(), ShakeCarrier(world, body)
    carrier.lift(0, 0)
    for share in (0.25, 0.5, 1.0, 1.25, 1.5, 2.0):
        carrier.advance_to(share / settings.shake_frequency)
        X_expected = X_WG @ inverse(seen_from_the_hand(settings, share)) @ inverse(X_WG) @ X_WO
        np.testing.assert_allclose(world.X_WB(body)[:3, :3], X_expected[:3, :3], atol=3e-3)
        np.testing.assert_allclose(world.X_WB(body)[:3, 3], X_expected[:3, 3], atol=1e-3)


def test_an_untouched_body_of_parallel_worlds_stays_where_it_is(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their kernels have formulas of their own. The strokes are quick, so that steps are few."""
    module = pytest.importorskip("burg_drake.simulation.batch.parallel_worlds")
    settings = ShakeSettings(
        shake_acceleration=200.0, turn_acceleration=1000.0, shake_frequency=10.0, shake_periods=1
    )
    quarter, found = 0.25 / settings.shake_frequency, []

    class ShakenAtOnce(module._Batch):
        def run(self, progress: object) -> None:
            self._begin_trials()
            module.mujoco_warp.kinematics(self._model, self._data)
            with module.fixed_order(self._data):
                for _ in range(8):
                    self._state.phase.fill_(module.trial_kernels.LIFT)
                    self._advance()
                    begin = self._constants.target_qpos
                    found.append(self._data.qpos.numpy()[0, begin : begin + 7].copy())

    monkeypatch.setattr(module, "_Batch", ShakenAtOnce)
    batch = BatchTrial(
        scene,
        make_station(),
        engine=replace(ENGINES["mujoco-gpu"], time_step=quarter / 100),
        settings=TrialSettings(shake=settings, poll=quarter, **NO_GRIP_LIMITS),
        device="cpu",
    )
    batch.run("box", UNTOUCHED[None])
    X_WO = batch.single.X_WO("box")
    X_WG = X_WO @ UNTOUCHED
    for k, (x, y, z, *wxyz) in enumerate(found, start=1):
        X_GG = seen_from_the_hand(settings, 0.25 * k)
        X_expected = X_WG @ inverse(X_GG) @ inverse(X_WG) @ X_WO
        R_WO = Rotation.from_quat(np.roll(wxyz, -1)).as_matrix()
        np.testing.assert_allclose(R_WO, X_expected[:3, :3], atol=3e-3)
        np.testing.assert_allclose((x, y, z), X_expected[:3, 3], atol=2e-3)


def begin(trial: HandTrial | MujocoTrial, X_OG: Array):
    """A world at the start of a trial, and the pose of the target in it."""
    X_WO = trial.X_WO("box")
    if isinstance(trial, HandTrial):
        trial.begin("box", X_WO @ X_OG)
        return trial.world, X_WO
    world, up = trial.world_of("box"), np.array((0.0, 0.0, 1.0))
    world.prepare("box", X_WO @ X_OG, 0.0, up, friction=None, mass=None)
    return world, X_WO


@pytest.mark.parametrize("engine", ENGINES_TO_SHAKE)
def test_slides_by_coulombs_law(scene: Scene, engine: str) -> None:
    """A block between two pads sticks below the limit, and slides beyond it."""
    friction = 0.05
    limit = 2.0 * friction * FORCE / BOX_MASS
    slips = {}
    for ratio in (0.9, 1.3):
        settings = {"shake_acceleration": ratio * limit, "turn_acceleration": 0.0}
        trial = shaken(scene, engine, shake_periods=1, **settings)
        result = trial.run("box", from_above(0.055), friction=friction)
        assert result.outcome is Outcome.LIFTED and result.confidence is None
        assert np.isnan(result.margins.lift)
        slips[ratio] = result.margins.slip
    assert slips[0.9] < 5e-4
    assert slips[1.3] == pytest.approx(sliding_block(1.3 * limit, limit), rel=0.1)


def sliding_block(acceleration: float, limit: float) -> float:
    """Distance by which a block has slid on a support after one period of shaking [m]."""
    omega, step, speed, slid = 2.0 * np.pi * ShakeSettings().shake_frequency, 1e-5, 0.0, 0.0
    for k in range(round(2.0 * np.pi / omega / step)):
        load = -acceleration * np.cos(omega * k * step)
        after = speed + step * load
        # Friction stops the block if it can.
        speed = np.sign(after) * max(0.0, abs(after) - step * limit)
        slid += step * speed
    return abs(slid)


# --- symmetry -------------------------------------------------------------------------------------


@pytest.mark.parametrize("engine", ENGINES_TO_SHAKE)
def test_the_same_with_fingers_swapped_and_the_object_turned(make_scene, engine: str) -> None:
    X_OG = from_above(0.065, y=0.03, yaw=0.1)
    results = []
    upright, turned = (0.0, 0.0, 0.0), (100.0, -35.0, 70.0)
    for rpy, grasp in ((upright, X_OG), (upright, swap_fingers(X_OG)), (turned, X_OG)):
        trial = shaken(make_scene(in_the_air("box", rpy)), engine, turn_acceleration=200.0)
        results.append(trial.run("box", grasp, friction=0.3, mass=2.0 * BOX_MASS))
    one, *others = results
    assert one.margins.tilt > np.deg2rad(5.0)
    for other in others:
        assert other.outcome is one.outcome
        assert other.margins.tilt == pytest.approx(one.margins.tilt, abs=np.deg2rad(1.5))
        assert other.margins.slip == pytest.approx(one.margins.slip, abs=5e-4)


def test_a_target_that_is_shaken_off_has_slipped(scene: Scene) -> None:
    trial = shaken(scene, "mujoco", shake_acceleration=60.0)
    assert trial.run("box", from_above(0.075), friction=0.02).outcome is Outcome.SLIPPED


# --- what is refused ------------------------------------------------------------------------------


def test_only_one_object_away_from_the_table_is_shaken(make_scene) -> None:
    for scene, why in (
        (make_scene(in_the_air("box"), Instance(object="ball")), "has 2 objects"),
        (make_scene(in_the_air("box", height=0.0)), "too near to the table"),
    ):
        with pytest.raises(InvalidInputError, match=why):
            shaken(scene, "screening")


def test_strength_and_duration_are_checked() -> None:
    assert ShakeSettings(shake_frequency=4.0, shake_periods=3).duration == pytest.approx(1.5)
    with pytest.raises(InvalidInputError, match="shake_frequency"):
        replace(ShakeSettings(), shake_frequency=0.0)
