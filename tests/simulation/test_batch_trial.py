"""Trials in parallel worlds: statics, what they share with those one by one, and their bits.

All run on Warp's CPU device. The order of threads on a card is another matter, so one test turns
the order of contacts around.
"""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from trial_world import BOX_MASS, CENTRE, FORCE, GRAVITY, PAD, from_above, lifting, make_station

from burg_drake.core import (
    Array,
    DeviceError,
    InvalidInputError,
    MissingDependencyError,
    Outcome,
    Pose,
    grasp_from_axes,
    swap_fingers,
)
from burg_drake.scene import Instance, Scene
from burg_drake.simulation import (
    DEFAULT_TRIAL,
    NO_GRIP_LIMITS,
    BatchTrial,
    MujocoTrial,
    ShakeSettings,
    TrialResult,
    TrialSettings,
    claimed,
    describe_devices,
    find_devices,
    kernels_are_compiled,
)
from burg_drake.station import ENGINES, GraspMotion, Obstacle
from tests.thorough import thorough

parallel_worlds = pytest.importorskip("burg_drake.simulation.batch.parallel_worlds")
wp = pytest.importorskip("warp")
mujoco_warp = pytest.importorskip("mujoco_warp")

LOAD = GRAVITY + DEFAULT_TRIAL.acceleration
"""Weight and inertia of a mass while the hand accelerates [m/s^2]."""
LIMIT = BOX_MASS * LOAD / (2 * FORCE)
"""Friction with which the pads just carry the box."""
LEVER = 0.04
"""From the middle of the bar to where it is gripped [m]."""


def batch_of(scene: Scene, **more: Any) -> BatchTrial:
    station = more.pop("station", None) or make_station()
    return BatchTrial(scene, station, device="cpu", **more)


@pytest.fixture(scope="module")
def scene(make_scene) -> Scene:
    """Box, bar and ball, far apart."""
    return make_scene(("box", 0.1, 0.2, 0.0), ("bar", 0.3, 0.2, 0.0), ("ball", 0.5, 0.2, 0.0))


def exact(result: TrialResult) -> dict[str, str]:
    """All that a trial returns, to the bit."""
    words = {"outcome": str(result.outcome), "blocker": result.blocker, "reason": result.reason}
    numbers = asdict(result.margins) | {"confidence": result.confidence or np.nan}
    return words | {name: float(value).hex() for name, value in numbers.items()}


GRASPS = [
    (CENTRE, 0.98 * LIMIT, BOX_MASS),
    (CENTRE, 1.02 * LIMIT, BOX_MASS),
    (CENTRE, 0.98 * 2.0 * LIMIT, 2.0 * BOX_MASS),
    (CENTRE, 1.02 * 2.0 * LIMIT, 2.0 * BOX_MASS),
    (CENTRE, 0.5, BOX_MASS),
    (from_above(0.06, y=0.01, yaw=0.1), 0.15, BOX_MASS),
    (swap_fingers(from_above(0.06, y=0.01, yaw=0.1)), 0.15, BOX_MASS),
    (from_above(0.065, y=0.035), 0.15, BOX_MASS),
    (from_above(0.12), 0.5, BOX_MASS),
    (from_above(0.0), 0.5, BOX_MASS),
]
"""Grasps of the box with friction and mass: statics, symmetry, an empty one and one in
collision."""


@pytest.fixture(scope="module")
def columns() -> tuple[Array, Array, Array]:
    X_OG, friction, mass = zip(*GRASPS, strict=True)
    return np.array(X_OG), np.array(friction), np.array(mass)


@pytest.fixture(scope="module")
def results(scene: Scene, columns) -> list[TrialResult]:
    X_OG, friction, mass = columns
    return batch_of(scene).run("box", X_OG, friction=friction, mass=mass)


# --- statics --------------------------------------------------------------------------------------


def test_holds_up_to_coulombs_limit_for_any_mass(results: list[TrialResult]) -> None:
    outcomes = [result.outcome for result in results[:4]]
    assert outcomes == 2 * [Outcome.SLIPPED, Outcome.LIFTED]
    assert results[1].margins.lift == pytest.approx(0.30, abs=2e-3)


def test_pads_press_with_the_commanded_force_and_their_whole_faces(
    results: list[TrialResult],
) -> None:
    margins = results[4].margins
    assert margins.pad_force == pytest.approx(FORCE, rel=2e-3)
    assert margins.patch_area == pytest.approx(PAD[0] * PAD[1], rel=1e-9)
    assert margins.slip < 5e-5 and margins.tilt < np.deg2rad(0.1)


def test_the_same_with_fingers_swapped(results: list[TrialResult]) -> None:
    one, other = results[5:7]
    assert one.outcome is other.outcome
    assert other.margins.tilt == pytest.approx(one.margins.tilt, abs=np.deg2rad(1.0))
    assert other.margins.slip == pytest.approx(one.margins.slip, abs=2e-4)


def test_shakes_as_the_engine_on_the_cpu_does(make_scene) -> None:
    """Quickly along the approach and about the closing axis, near what the pads hold."""
    scene = make_scene(Instance(object="box", X_SO=Pose((0.3, 0.2, 0.6), rpy_deg=(0, 0, 40.0))))
    shake = ShakeSettings(
        shake_acceleration=12.0, turn_acceleration=250.0, shake_frequency=8.0, shake_periods=1
    )
    settings = TrialSettings(shake=shake, **NO_GRIP_LIMITS)
    X_OG = np.array([CENTRE, from_above(0.065, y=0.03), swap_fingers(from_above(0.065, y=0.03))])
    friction = np.array([0.03, 0.15, 0.15])
    batch = batch_of(scene, settings=settings)
    found = batch.run("box", np.tile(X_OG, (4, 1, 1)), friction=np.tile(friction, 4))
    assert len(found) > batch.worlds  # so that worlds are used again
    for k, result in enumerate(found):
        assert exact(result) == exact(found[k % 3])
    single = MujocoTrial(scene, make_station(), settings=settings)
    for result, X, mu in zip(found[:3], X_OG, friction.tolist(), strict=True):
        expected = single.run("box", X, friction=mu)
        assert result.outcome is expected.outcome is Outcome.LIFTED
        assert result.margins.slip == pytest.approx(expected.margins.slip, rel=0.1, abs=1e-4)
        assert result.margins.tilt == pytest.approx(expected.margins.tilt, rel=0.1, abs=0.005)
        assert np.isnan(result.margins.lift) and result.confidence is None
    assert found[0].margins.slip > 3e-4
    assert found[1].margins.tilt > np.deg2rad(2.0)


# --- as one by one --------------------------------------------------------------------------------


def assert_alike(one: TrialResult, other: TrialResult) -> None:
    """Up to rounding; not how far something fell that was lost."""
    assert (one.outcome, one.blocker) == (other.outcome, other.blocker)
    assert one.toppled == other.toppled
    for mine, theirs in ((one.displacements, other.displacements), (one.turned, other.turned)):
        assert mine == pytest.approx(theirs, abs=3e-3)
    mine, theirs = asdict(one.margins), asdict(other.margins)
    for name, tolerance in {
        "clearance": 0.0,
        "slip": 1e-4,
        "tilt": 0.01,
        "pad_force": 0.1,
        "patch_area": 1.5e-5,  # a sphere and a half
        "lift": 5e-4,
        "end_time": 0.0201,
        "others_moved": 3e-4,
        "pushed": 1e-5,
    }.items():
        if one.outcome.held or name not in ("slip", "tilt", "lift"):
            assert mine[name] == pytest.approx(theirs[name], abs=tolerance, nan_ok=True), name


def test_results_are_those_of_trials_one_by_one(
    scene: Scene, columns, results: list[TrialResult]
) -> None:
    trial = MujocoTrial(scene, make_station())
    for result, X_OG, friction, mass in zip(results, *columns, strict=True):
        assert_alike(result, trial.run("box", X_OG, friction=friction, mass=mass))
    found = {result.outcome for result in results}
    assert Outcome.NO_CONTACT in found and any(one.stage == "clear" for one in found)


def test_what_is_known_to_be_clear_is_not_screened_again(
    scene: Scene, columns, results: list[TrialResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    X_OG, friction, _ = columns
    batch = batch_of(scene)
    monkeypatch.delattr(batch.single.clearance, "_screen")
    monkeypatch.setattr(batch.single, "closed_before_contacts", lambda name, X_WG: np.zeros(1))
    (result,) = batch.run("box", X_OG[[4]], friction=friction[4], known_clear=True)
    assert result.outcome is results[4].outcome
    assert np.isnan(result.margins.clearance)


@pytest.mark.parametrize(
    "motion",
    [
        GraspMotion(retreat=0.05, lift_height=0.1),
        thorough(GraspMotion(lift_height=0.2, lift_direction=(0.0, 1.0, 1.0))),
    ],
)
def test_other_motions_are_followed(scene: Scene, motion: GraspMotion) -> None:
    batch = batch_of(scene, motion=motion)
    (result,) = batch.run("box", CENTRE[None], friction=0.6)
    assert_alike(result, batch.single.run("box", CENTRE, friction=0.6))
    assert result.margins.lift == pytest.approx(motion.retreat + motion.lift_height, abs=1e-3)
    assert batch.on_cpu == 0


def test_each_grasp_has_its_own_lift(scene: Scene) -> None:
    lifts = np.array([0.05, np.nan])
    short, usual = batch_of(scene).run("box", np.array([CENTRE, CENTRE]), lift=lifts)
    assert short.margins.lift == pytest.approx(0.05, abs=1e-3)
    assert usual.margins.lift == pytest.approx(0.30, abs=2e-3)


def test_the_hand_can_begin_at_the_pregrasp(scene: Scene) -> None:
    batch = batch_of(scene, settings=replace(lifting(0.1, 0.7), approach=True))
    (result,) = batch.run("box", CENTRE[None], friction=0.5)
    assert_alike(result, batch.single.run("box", CENTRE, friction=0.5))
    assert result.outcome is Outcome.LIFTED and result.pushed["box"] < 1e-3
    assert batch.on_cpu == 0


@pytest.mark.parametrize("height", [thorough(0.30), 0.45])
def test_a_shelf_in_the_way_ends_the_trial(make_scene, height: float) -> None:
    """That of a hand that is decided early, too."""
    shelf = Obstacle(X_WB=Pose((0.3, 0.2, height + 0.01)), size=(0.6, 0.2, 0.02))
    station = make_station(obstacles={"shelf": shelf})
    batch = batch_of(make_scene(("box", 0.3, 0.2, 0.0)), station=station)
    (result,) = batch.run("box", CENTRE[None])
    assert (result.outcome, result.blocker) == (Outcome.BLOCKED, "shelf")
    assert_alike(result, batch.single.run("box", CENTRE))


@pytest.mark.thorough
def test_a_hand_that_goes_down_is_blocked_by_the_table(make_scene) -> None:
    motion = GraspMotion(lift_height=0.15, lift_direction=(0.0, -1.0, -0.02))
    batch = batch_of(make_scene(("bar", 0.3, 0.2, 90.0)), motion=motion)
    X_OG = from_above(0.0105)
    (result,) = batch.run("bar", X_OG[None], friction=0.5)
    single = batch.single.run("bar", X_OG, friction=0.5)
    assert result.outcome is single.outcome is Outcome.BLOCKED
    assert result.blocker == single.blocker == "table"


def test_paths_are_free_at_a_glance_only_below_the_shelf(make_scene) -> None:
    shelf = Obstacle(X_WB=Pose((0.3, 0.2, 0.46)), size=(0.6, 0.2, 0.02))
    station = make_station(obstacles={"shelf": shelf})
    trial = MujocoTrial(make_scene(("box", 0.3, 0.2, 0.0)), station)
    start, up = trial.X_WG("box", CENTRE), np.array((0.0, 0.0, 0.01))
    X_WG, X_WO = (np.tile(X, (3, 1, 1)) for X in (start, trial.X_WO("box")))
    X_WG[:, :3, 3], X_WO[:, :3, 3] = X_WG[:, :3, 3] + up, X_WO[:, :3, 3] + up
    lengths = np.array([0.1, 0.25, 0.32])
    free = trial.lift_clearance("box").clearly_free(X_WG, X_WO, lengths[:, None] * up / 0.01)
    assert free.tolist() == [True, True, False]


@pytest.fixture(scope="module")
def crowd(make_scene) -> BatchTrial:
    """A block beside the box, lower than the fingers, and one on a second box."""
    scene = make_scene(
        ("box", 0.15, 0.2, 0.0),
        Instance(name="carrier", object="box", X_SO=Pose((0.45, 0.2, 0.0))),
        Instance(name="beside", object="block", X_SO=Pose((0.207, 0.21, 0.0))),
        Instance(name="on_top", object="block", X_SO=Pose((0.45, 0.235, 0.08))),
    )
    return batch_of(scene, settings=TrialSettings(**NO_GRIP_LIMITS))


def test_a_touched_neighbour_moves(crowd: BatchTrial) -> None:
    """The fingers centre the box, which pushes a block; this needs the complete world."""
    X_OG = from_above(0.065, x=0.006)
    (result,) = crowd.run("box", X_OG[None])
    assert_alike(result, crowd.single.run("box", X_OG))
    assert result.displacements["beside"] == result.margins.others_moved > 0.001
    assert crowd.on_cpu == 0 and not result.on_cpu


@pytest.mark.thorough
def test_what_lies_on_the_target_goes_up_with_it(crowd: BatchTrial) -> None:
    X_OG = from_above(0.05, y=-0.03)
    (result,) = crowd.run("carrier", X_OG[None], friction=0.8)
    single = crowd.single.run("carrier", X_OG, friction=0.8)
    assert result.outcome is single.outcome is Outcome.LIFTED_DISTURBED
    assert result.displacements["on_top"] > 0.2
    assert result.margins.others_moved == pytest.approx(single.margins.others_moved, abs=0.02)


@pytest.mark.thorough
def test_what_the_hand_touches_on_its_way_in_is_executed_on_the_cpu(make_scene) -> None:
    """A finger meets a rail that it is clear of at both ends of the way."""
    level = grasp_from_axes((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.04))
    rail = Obstacle(X_WB=Pose((0.3476, 0.005, 0.04)), size=(0.01, 0.05, 0.02))
    batch = batch_of(
        make_scene(("post", 0.3, 0.2, 0.0)),
        station=make_station(obstacles={"rail": rail}),
        settings=TrialSettings(approach=True),
        motion=GraspMotion(standoff=0.30),
    )
    (result,) = batch.run("post", level[None])
    assert (result.outcome, result.blocker) == (Outcome.BLOCKED, "rail")
    assert exact(result) == exact(batch.single.run("post", level))
    assert batch.on_cpu == 1


def test_fingers_close_as_far_as_one_by_one(scene: Scene) -> None:
    """But for a step of the search, where they touch by less than counts."""
    trial = MujocoTrial(scene, make_station())
    asked = [CENTRE, from_above(0.06, y=0.01, yaw=0.1), from_above(0.12), from_above(0.06, x=0.01)]
    X_WG = np.array([trial.X_WG("box", X_OG) for X_OG in asked])
    together = trial.clearance.free_travels(X_WG)
    each = [trial.clearance.free_travel(X) for X in X_WG]
    np.testing.assert_allclose(together, each, atol=0.0251)
    assert len(set(each)) > 2


# --- bits -----------------------------------------------------------------------------------------


def test_the_same_bits_alone_and_among_others_in_any_order(
    scene: Scene, columns, results: list[TrialResult]
) -> None:
    X_OG, friction, mass = columns
    order = np.array([7, 1, 4, 0, 5])
    few = batch_of(scene, worlds=2)
    again = few.run("box", X_OG[order], friction=friction[order], mass=mass[order])
    (alone,) = few.run("box", X_OG[[5]], friction=friction[5], mass=mass[5])
    assert [exact(result) for result in again] == [exact(results[k]) for k in order]
    assert exact(alone) == exact(results[5])


def turned(collision: Callable[..., None]) -> Callable[..., None]:
    """Finds collisions, in the opposite order."""

    def collide(model: Any, data: Any, **more: Any) -> None:
        collision(model, data, **more)
        turn_contacts(data)

    return collide


def turn_contacts(data: Any) -> None:
    """Reverses the order of the contacts."""
    for field in fields(data.contact):
        values = getattr(data.contact, field.name)
        if getattr(values, "shape", (0,))[0] == data.naconmax:
            words = flat_words(values)
            before = wp.clone(words)
            wp.launch(turn, dim=words.shape, inputs=[data.nacon, before], outputs=[words])


def flat_words(values: Any) -> Any:
    """An array on the device as rows of four bytes, in the same memory."""
    rows = values.shape[0]
    size = values.capacity // (4 * rows)
    return wp.array(ptr=values.ptr, dtype=int, shape=(rows, size), device=values.device, copy=False)


@wp.kernel(enable_backward=False)
def turn(nacon: wp.array(dtype=int), before: wp.array2d(dtype=int), after: wp.array2d(dtype=int)):
    i, k = wp.tid()
    n = nacon[0]
    if i < n:
        after[i, k] = before[n - 1 - i, k]


TURNED_ROWS = [5, 7]
"""Grasps in which the order of contacts matters."""


def bits(scene: Scene, columns) -> list[dict[str, str]]:
    """Results of `TURNED_ROWS`."""
    X_OG, friction, _ = columns
    found = batch_of(scene).run("box", X_OG[TURNED_ROWS], friction=friction[TURNED_ROWS])
    return [exact(result) for result in found]


def test_the_same_bits_whatever_the_order_of_contacts(
    scene: Scene, columns, results: list[TrialResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    from mujoco_warp._src import collision_driver

    monkeypatch.setattr(collision_driver, "collision", turned(collision_driver.collision))
    assert bits(scene, columns) == [exact(results[k]) for k in TURNED_ROWS]


@pytest.mark.parametrize("sorts", [False, True])
def test_without_a_fixed_order_bits_depend_on_that_of_contacts(
    scene: Scene, columns, monkeypatch: pytest.MonkeyPatch, sorts: bool
) -> None:
    """Also if MuJoCo Warp is asked to sort them. Once this fails, it has learned a fixed order, and
    `fixed_order` can go."""
    from mujoco_warp._src import collision_driver
    from mujoco_warp._src.types import DeterminismType

    monkeypatch.setattr(parallel_worlds, "fixed_order", lambda data: nullcontext())
    sort, put_model = collision_driver._sort_contacts, mujoco_warp.put_model

    def put_model_that_sorts(*args: Any, **kwargs: Any) -> Any:
        model = put_model(*args, **kwargs)
        model.opt.deterministic = DeterminismType.CONTACTS | DeterminismType.CONSTRAINT
        return model

    def turn_and_sort(model: Any, data: Any) -> None:
        turn_contacts(data)
        sort(model, data)

    if sorts:
        monkeypatch.setattr(mujoco_warp, "put_model", put_model_that_sorts)
    found = bits(scene, columns)
    if sorts:
        monkeypatch.setattr(collision_driver, "_sort_contacts", turn_and_sort)
    else:
        monkeypatch.setattr(collision_driver, "collision", turned(collision_driver.collision))
    assert bits(scene, columns) != found


def test_worlds_without_room_for_their_contacts_run_again(
    scene: Scene, columns, results: list[TrialResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The box touches 72 spheres, with three rows each."""
    X_OG, friction, _ = columns
    rooms: list[int] = []

    class Narrow(parallel_worlds.Room):
        def __init__(self, rows: int = 64, contacts: int = 24) -> None:
            super().__init__(rows, contacts)
            rooms.append(rows)

    monkeypatch.setattr(parallel_worlds, "Room", Narrow)
    (result,) = batch_of(scene).run("box", X_OG[[4]], friction=friction[[4]])
    assert exact(result) == exact(results[4])
    assert 64 in rooms and max(rooms) >= 256


def test_trials_that_fit_into_no_room_are_executed_on_the_cpu(
    scene: Scene, columns, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Narrow(parallel_worlds.Room):
        def __init__(self, rows: int = 64, contacts: int = 24) -> None:
            super().__init__(64, 24)

    monkeypatch.setattr(parallel_worlds, "Room", Narrow)
    X_OG, friction, _ = columns
    batch = batch_of(scene)
    (result,) = batch.run("box", X_OG[[4]], friction=friction[[4]])
    assert batch.on_cpu == 1 and result.on_cpu
    assert exact(result) == exact(batch.single.run("box", X_OG[4], friction=float(friction[4])))


# --- the device -----------------------------------------------------------------------------------


def test_where_memory_is_short_there_are_fewer_worlds_from_then_on(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[int] = []
    make_data, room_for = mujoco_warp.make_data, 10

    def make_some(model: Any, nworld: int, **more: Any) -> Any:
        made.append(nworld)
        if nworld > room_for:
            raise RuntimeError("Failed to allocate 4 bytes on device 'cuda:0'")
        return make_data(model, nworld=nworld, **more)

    monkeypatch.setattr(mujoco_warp, "make_data", make_some)
    missed = np.tile(from_above(0.12), (40, 1, 1))
    batch = batch_of(scene, worlds=40)
    rounds = []
    for _ in range(3):
        made.clear()
        results = batch.run("box", missed)
        assert {result.outcome for result in results} == {Outcome.NO_CONTACT}
        rounds.append(tuple(made))
    assert rounds[0] == (40, 20, 10)
    assert rounds[2] == (10,)
    room_for = 0
    with pytest.raises(DeviceError, match="device cpu failed: RuntimeError: Failed to allocate"):
        batch.run("box", missed)


def test_kernels_are_replaced_for_one_batch_at_a_time() -> None:
    """Else the one that leaves last would leave those of the other behind."""
    from mujoco_warp._src import solver

    original, data = solver._update_gradient_grad, SimpleNamespace(nworld=1, njmax=3)
    entered = threading.Event()

    def enter() -> None:
        with parallel_worlds.fixed_order(data):
            entered.set()

    other = threading.Thread(target=enter)
    with wp.ScopedDevice("cpu"), parallel_worlds.fixed_order(data):
        other.start()
        assert not entered.wait(0.2)
        assert solver._update_gradient_grad is not original
    other.join(10.0)
    assert entered.is_set() and solver._update_gradient_grad is original


def test_kernels_are_compiled_once_a_batch_has_run(
    scene: Scene, results, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not yet if only those of trials are: MuJoCo Warp's take longer, and come later."""
    (device,) = find_devices("cpu")
    assert kernels_are_compiled(device)
    module = wp.get_module(parallel_worlds.trial_kernels.__name__).get_module_identifier()
    (tmp_path / module).mkdir()
    (tmp_path / module / f"{module}.o").touch()
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    assert not kernels_are_compiled(device)


def test_an_old_driver_matters_to_cards_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    card, cpu = (SimpleNamespace(alias=a, is_cuda=a != "cpu") for a in ("cuda:0", "cpu"))
    monkeypatch.setattr(wp, "get_devices", lambda: [cpu, card])
    monkeypatch.setattr(wp, "is_conditional_graph_supported", lambda: False)
    assert find_devices("cpu") == [cpu]
    for name in (None, "cuda:0"):
        with pytest.raises(InvalidInputError, match=r"driver that supports CUDA 12\.4 or later"):
            find_devices(name)


def test_cards_are_described_with_what_their_driver_supports(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    card = SimpleNamespace(name="NVIDIA H100", is_cuda=True)
    monkeypatch.setattr(wp, "get_cuda_driver_version", lambda: (12, 8))
    monkeypatch.setattr(wp, "get_cuda_toolkit_version", lambda: (12, 9))
    told = "NVIDIA H100 (driver supports CUDA 12.8, Warp is built with CUDA 12.9)"
    assert describe_devices([card, card]) == told


def test_a_card_is_used_by_one_process_at_a_time(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Another process takes a free card, or waits for one; also if the owner is killed."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    cards = [SimpleNamespace(is_cuda=True, uuid=f"GPU-{k}") for k in range(2)]
    with owner_of(cards[0], tmp_path) as owner:
        with claimed(cards) as card:
            assert card is cards[1]
        taken: list[Any] = []
        waiting = threading.Thread(target=lambda: taken.append(enter(claimed(cards[:1]))))
        waiting.start()
        waiting.join(0.3)
        assert waiting.is_alive() and not taken
        owner.kill()
        waiting.join(10.0)
        assert taken == cards[:1]


def enter(context: Any) -> Any:
    with context as value:
        return value


@contextmanager
def owner_of(card: Any, folder: Path) -> Iterator[subprocess.Popen[str]]:
    """A process that has claimed a card."""
    program = (
        "import sys, tempfile; from types import SimpleNamespace;"
        " from burg_drake.simulation import claimed; tempfile.tempdir = sys.argv[1]\n"
        "with claimed([SimpleNamespace(is_cuda=True, uuid=sys.argv[2])]):"
        " print('claimed', flush=True); sys.stdin.read()"
    )
    words = [sys.executable, "-c", program, str(folder), card.uuid]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(words, **pipes) as process:
        assert process.stdout is not None and process.stdout.readline() == "claimed\n"
        yield process
        process.kill()


def test_the_cpu_is_used_by_any_number_of_processes(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    cpu = SimpleNamespace(is_cuda=False)
    with claimed([cpu]) as one, claimed([cpu]) as other:
        assert one is other is cpu
    assert not list(tmp_path.iterdir())


# --- refusals -------------------------------------------------------------------------------------


def test_a_card_is_needed_and_named(scene: Scene) -> None:
    if wp.is_cuda_available():
        pytest.skip("there is a card")
    with pytest.raises(InvalidInputError, match="needs an NVIDIA card, and there is none here"):
        BatchTrial(scene, make_station())
    with pytest.raises(InvalidInputError, match="there is no device 'cuda:7' here; there is cpu"):
        BatchTrial(scene, make_station(), device="cuda:7")


def test_other_versions_are_refused(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.metadata.version", lambda package: "5.0.0")
    message = r"needs mujoco-warp 4.0.0; 5.0.0 is installed; .*burg-drake\[gpu\]"
    with pytest.raises(MissingDependencyError, match=message):
        batch_of(scene)


def test_bad_input_is_refused(scene: Scene) -> None:
    batch = batch_of(scene)
    with pytest.raises(InvalidInputError, match="'cup' is not a free instance"):
        batch.run("cup", CENTRE[None])
    with pytest.raises(InvalidInputError, match=r"mass is -1\.0 kg"):
        batch.run("box", CENTRE[None], mass=[-1.0])
    with pytest.raises(InvalidInputError, match="lift is 0 m and retreat 0 m"):
        batch.run("box", CENTRE[None], lift=[0.0])
    assert batch.run("box", np.zeros((0, 4, 4))) == []
    assert batch.single.engine == ENGINES["mujoco-gpu"]
