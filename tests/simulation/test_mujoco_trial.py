"""Trials on MuJoCo against statics and symmetry, and what they share with those of Drake."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from trial_world import BOX_MASS, CENTRE, FORCE, GRAVITY, PAD, from_above, lifting, make_station

from burg_drake.core import Array, InvalidInputError, Outcome, Pose, swap_fingers
from burg_drake.scene import Instance, Scene
from burg_drake.simulation import (
    DEFAULT_TRIAL,
    NO_GRIP_LIMITS,
    HandTrial,
    MujocoTrial,
    TrialResult,
    TrialSettings,
    check_objects,
)
from burg_drake.station import ENGINES, GraspMotion, Obstacle

mujoco = pytest.importorskip("mujoco")

ENGINE = ENGINES["mujoco"]
LOAD = GRAVITY + DEFAULT_TRIAL.acceleration
"""Weight and inertia of a mass while the hand accelerates [m/s^2]."""
BAR_MASS, LEVER = 0.2, 0.04
"""Of the bar [kg], and from its middle to where it is gripped [m]."""


@pytest.fixture(scope="module")
def scene(make_scene) -> Scene:
    """Box, bar and ball, far apart."""
    return make_scene(("box", 0.1, 0.2, 0.0), ("bar", 0.3, 0.2, 0.0), ("ball", 0.5, 0.2, 0.0))


@pytest.fixture(scope="module")
def trial(scene: Scene) -> MujocoTrial:
    return MujocoTrial(scene, make_station())


@pytest.fixture(scope="module")
def crowd(make_scene) -> Scene:
    """A block beside the box, lower than the fingers, and one on a second box."""
    return make_scene(
        ("box", 0.15, 0.2, 0.0),
        Instance(name="carrier", object="box", X_SO=Pose((0.45, 0.2, 0.0))),
        Instance(name="beside", object="block", X_SO=Pose((0.207, 0.21, 0.0))),
        Instance(name="on_top", object="block", X_SO=Pose((0.45, 0.235, 0.08))),
    )


def exact(result: TrialResult) -> dict[str, str]:
    """All that a trial returns, to the bit."""
    moved = {f"moved {name}": value for name, value in result.displacements.items()}
    words = {"outcome": str(result.outcome), "blocker": result.blocker, "reason": result.reason}
    return words | {k: float(v).hex() for k, v in (asdict(result.margins) | moved).items()}


# --- statics --------------------------------------------------------------------------------------


def test_holds_up_to_coulombs_limit(trial: MujocoTrial) -> None:
    limit = BOX_MASS * LOAD / (2 * FORCE)
    assert trial.run("box", CENTRE, friction=0.98 * limit).outcome is Outcome.SLIPPED
    held = trial.run("box", CENTRE, friction=1.02 * limit)
    assert held.outcome is Outcome.LIFTED
    assert held.margins.lift == pytest.approx(0.30, abs=2e-3)


def test_the_limit_grows_with_a_mass_in_place_of_the_librarys(trial: MujocoTrial) -> None:
    limit = 1.2 * LOAD / (2 * FORCE)
    for share, outcome in ((0.98, Outcome.SLIPPED), (1.02, Outcome.LIFTED)):
        assert trial.run("box", CENTRE, friction=share * limit, mass=1.2).outcome is outcome


def test_pads_press_with_the_commanded_force_and_their_whole_faces(trial: MujocoTrial) -> None:
    margins = trial.run("box", CENTRE, friction=0.5).margins
    assert margins.pad_force == pytest.approx(FORCE, rel=2e-3)
    assert margins.patch_area == pytest.approx(PAD[0] * PAD[1], rel=1e-9)
    assert margins.slip < 5e-5 and margins.tilt < np.deg2rad(0.1)


def test_pads_are_as_stiff_as_an_elastic_layer(trial: MujocoTrial) -> None:
    """Modulus over half the thickness, as pressure grows to the modulus in the pad's middle."""
    trial.run("box", CENTRE, friction=0.5)
    contact = trial.world.data.contact
    depth = FORCE / (1e7 / (0.0152 / 2) * PAD[0] * PAD[1])
    pads = -contact.dist[contact.dist < -depth / 2]
    assert len(pads) == 72
    np.testing.assert_allclose(pads, depth, rtol=0.05)


def turning_friction() -> float:
    """Smallest friction with which two patches of even pressure carry the bar beside its middle.

    At the limit a patch turns about a point on the line to the weight, and every spot rubs across
    the line to that point.
    """
    n = 200
    y, z = np.meshgrid(*(((np.arange(n) + 0.5) / n - 0.5) * size for size in PAD))
    near, far = 1e-6, 1.0
    while far - near > 1e-9:
        middle = (near + far) / 2
        r = np.hypot(y + middle, z)
        force = float(((y + middle) / r).mean())
        moment = float(((z * z + y * (y + middle)) / r).mean())
        near, far = (middle, far) if moment > LEVER * force else (near, middle)
    return BAR_MASS * LOAD / (2 * FORCE * force)


def test_pads_bear_the_torque_of_their_patch(trial: MujocoTrial) -> None:
    beside = from_above(0.02, y=LEVER)
    tilts = [
        trial.run("bar", beside, friction=share * turning_friction()).margins.tilt
        for share in (0.92, 1.08)
    ]
    assert tilts[1] < np.deg2rad(1.0) < np.deg2rad(3.0) < tilts[0]


def test_what_is_held_does_not_creep_while_the_hand_speeds_up(trial: MujocoTrial) -> None:
    """Servos with a high rate had it ahead of the hand by 2 mm/s."""
    whole = MujocoTrial(trial.scene, trial.station, engine=replace(ENGINE, whole_trial=True))
    assert whole.run("box", CENTRE, friction=0.3).margins.slip < 5e-5


def test_contacts_have_drakes_friction(trial: MujocoTrial) -> None:
    """2ab/(a+b) with the table, and the target's own with the fingers."""
    complete = MujocoTrial(trial.scene, trial.station, lock=False)
    complete.run("bar", from_above(0.02, y=LEVER), friction=0.1)
    world, found = complete.world, {}
    names = {int(index): name for index, name in world.body_names.items()}
    for contact in world.data.contact:
        pair = (names.get(int(world.model.geom_bodyid[g]), "table") for g in contact.geom)
        found[frozenset(pair)] = contact.friction[0]
    own, table = trial.scene.entry("box").friction, trial.station.document.table.friction
    assert found[frozenset(("panda_leftfinger", "bar"))] == 0.1
    assert found[frozenset(("table", "box"))] == pytest.approx(2 * own * table / (own + table))


def test_pads_end_where_the_real_ones_do(trial: MujocoTrial) -> None:
    """The rubber of the Panda's finger: 17.5 x 15.2 x 18.5 mm (franka_ros, franka_hand.xacro)."""
    model = trial.world.model
    ends = []
    for k in range(model.ngeom):
        if model.geom(k).name.startswith("hand sphere panda_leftfinger"):
            center, radius = model.geom_pos[k], model.geom_size[k, 0]
            ends += [center - radius, center + radius]
    low, high = np.min(ends, axis=0), np.max(ends, axis=0)
    np.testing.assert_allclose((high - low)[[0, 2]], PAD, atol=1e-9)
    middle = np.array((0.0, 0.00758, 0.04525))
    np.testing.assert_allclose(((low + high) / 2)[[0, 2]], middle[[0, 2]], atol=1e-9)
    assert low[1] == pytest.approx(middle[1] - 0.0152 / 2, abs=2e-5)


def test_tips_that_the_screen_calls_clear_do_not_touch_the_table(make_scene) -> None:
    """Tips end 9.5 mm below the grasp frame, here 0.2 mm above the table."""
    settings = replace(lifting(0.1, 0.7), approach=True)
    trial = MujocoTrial(make_scene(("bar", 0.3, 0.2, 0.0)), make_station(), settings=settings)
    result = trial.run("bar", from_above(0.0097), friction=0.5)
    assert result.margins.clearance == pytest.approx(2e-4, abs=1e-5)
    assert (result.outcome, result.touched) == (Outcome.LIFTED, "")


# --- symmetry and identity ------------------------------------------------------------------------

GRASPS = [CENTRE, from_above(0.06, y=0.01, yaw=0.1), from_above(0.065, y=0.035)]


def test_the_same_with_fingers_swapped_and_the_world_turned(scene: Scene, trial) -> None:
    turned = MujocoTrial(scene, make_station(Pose((0.4, -0.1, 0.0), rpy_deg=(0.0, 0.0, 37.0))))
    for X_OG in GRASPS:
        one = trial.run("box", X_OG, friction=0.15)
        for other in (
            trial.run("box", swap_fingers(X_OG), friction=0.15),
            turned.run("box", X_OG, friction=0.15),
        ):
            assert other.outcome is one.outcome
            assert other.margins.tilt == pytest.approx(one.margins.tilt, abs=np.deg2rad(1.0))
            assert other.margins.slip == pytest.approx(one.margins.slip, abs=2e-4)


def test_the_same_bits_in_any_order(crowd: Scene) -> None:
    asked = [
        ("box", from_above(0.065), None, None),
        ("box", from_above(0.066, y=0.01, yaw=0.1), 0.02, None),
        ("box", from_above(0.07, x=-0.005), None, 0.9),
        ("carrier", from_above(0.05, y=-0.03), 0.8, 0.25),
        ("box", from_above(0.065, x=0.006), None, None),
    ]

    def run(trial: MujocoTrial, k: int) -> dict[str, str]:
        name, X_OG, friction, mass = asked[k]
        return exact(trial.run(name, X_OG, friction=friction, mass=mass))

    one, other = (MujocoTrial(crowd, make_station()) for _ in range(2))
    forwards = [run(one, k) for k in range(len(asked))]
    backwards = [run(other, k) for k in reversed(range(len(asked)))][::-1]
    assert forwards == backwards == [run(one, k) for k in range(len(asked))]
    assert len({str(found) for found in forwards}) == len(asked)


# --- what engines share ---------------------------------------------------------------------------


def test_the_screen_is_that_of_drakes_trials(scene: Scene, trial: MujocoTrial) -> None:
    drake = HandTrial(scene, make_station())
    outcomes = set()
    for X_OG in (from_above(0.0), from_above(0.05, x=0.03), from_above(-0.02, y=0.2), CENTRE):
        ours, theirs = trial.run("box", X_OG), drake.run("box", X_OG)
        outcomes.add(ours.outcome)
        assert ours.margins.clearance == theirs.margins.clearance
        if theirs.outcome.stage == "clear":
            assert ours == theirs
    assert {Outcome.COLLISION_TARGET, Outcome.COLLISION_TABLE, Outcome.LIFTED} <= outcomes


def test_empty_grasps(scene: Scene, trial: MujocoTrial) -> None:
    """A slippery ball that is gripped beside its middle is squeezed out."""
    assert trial.run("box", from_above(0.12)).outcome is Outcome.NO_CONTACT
    drake = HandTrial(scene, make_station())
    squeezed = [t.run("ball", from_above(0.03, y=0.024), friction=0.05) for t in (trial, drake)]
    assert {found.outcome for found in squeezed} == {Outcome.CLOSED_EMPTY}


@pytest.mark.parametrize("height", [0.30, 0.45])
def test_a_shelf_in_the_way_of_the_hand_ends_the_trial(make_scene, height: float) -> None:
    """The hand's top is 0.112 m above the grasp frame, which starts at 0.05 m."""
    shelf = Obstacle(X_WB=Pose((0.3, 0.2, height + 0.01)), size=(0.6, 0.2, 0.02))
    station = make_station(obstacles={"shelf": shelf})
    result = MujocoTrial(make_scene(("box", 0.3, 0.2, 0.0)), station).run("box", CENTRE)
    assert (result.outcome, result.blocker) == (Outcome.BLOCKED, "shelf")
    assert result.margins.lift == pytest.approx(height - 0.162, abs=0.006)


def test_a_neighbour_in_the_way_of_a_finger_is_pushed(crowd: Scene) -> None:
    """The fingers centre the box, which pushes a block. In the world of the box alone the touch
    shows, and the trial runs in the complete one."""
    X_OG = from_above(0.065, x=0.006)
    alone, complete = (
        MujocoTrial(crowd, make_station(), lock=lock).run("box", X_OG) for lock in (True, False)
    )
    assert exact(alone) == exact(complete)
    assert alone.displacements["beside"] == alone.margins.others_moved > 0.001


def test_what_lies_on_the_target_goes_up_with_it(crowd: Scene) -> None:
    trial = MujocoTrial(crowd, make_station(), settings=TrialSettings(**NO_GRIP_LIMITS))
    result = trial.run("carrier", from_above(0.05, y=-0.03), friction=0.8)
    assert result.outcome is Outcome.LIFTED_DISTURBED
    assert result.displacements["on_top"] > 0.2


def test_what_turns_in_the_hand_is_not_lifted(scene: Scene) -> None:
    """The tilt that limits forbid is the one that is measured without them."""
    beside, friction = from_above(0.02, y=LEVER), 0.6 * turning_friction()
    free = MujocoTrial(scene, make_station(), settings=TrialSettings(**NO_GRIP_LIMITS))
    strict = MujocoTrial(scene, make_station(), settings=TrialSettings(tilt_limit=0.02))
    one, other = (trial.run("bar", beside, friction=friction) for trial in (free, strict))
    assert (one.outcome, other.outcome) == (Outcome.LIFTED, Outcome.LIFTED_TURNED)
    assert one.margins.tilt > 0.02


@pytest.mark.parametrize(
    "motion",
    [
        GraspMotion(retreat=0.05, lift_height=0.1),
        GraspMotion(lift_height=0.2, lift_direction=(0.0, 1.0, 1.0)),
    ],
)
def test_the_target_follows_other_motions(scene: Scene, motion: GraspMotion) -> None:
    trial = MujocoTrial(scene, make_station(), engine=replace(ENGINE, whole_trial=True))
    trial.motion = motion
    start: Array = trial.diagram.X_WO("box")[:3, 3]
    result = trial.run("box", CENTRE, friction=0.6)
    assert result.outcome is Outcome.LIFTED
    assert result.margins.lift == pytest.approx(motion.retreat + motion.lift_height, abs=1e-3)
    moved = trial.world.X_WB(trial.world.free["box"])[:3, 3] - start
    way = motion.retreat * np.array((0.0, 0.0, 1.0)) + motion.lift_height * motion.direction_W
    np.testing.assert_allclose(moved, way, atol=1e-3)


def test_early_ends_are_those_of_whole_trials(scene: Scene, trial: MujocoTrial) -> None:
    whole = MujocoTrial(scene, make_station(), engine=replace(ENGINE, whole_trial=True))
    early, late = (t.run("box", CENTRE, friction=0.3) for t in (trial, whole))
    assert early.outcome is late.outcome is Outcome.LIFTED
    assert early.margins.end_time < 0.6 < 1.2 < late.margins.end_time
    assert early.margins.lift == pytest.approx(late.margins.lift, abs=1e-3)


def test_a_lift_that_is_asked_for(trial: MujocoTrial) -> None:
    assert trial.run("box", CENTRE, lift=0.05).margins.lift == pytest.approx(0.05, abs=1e-3)


def test_the_hand_can_begin_at_the_pregrasp(make_scene) -> None:
    """It comes in from above, and grips as if it had stood there."""
    scene = make_scene(("box", 0.3, 0.2, 0.0))
    settings = replace(lifting(0.1, 0.7), approach=True)
    trial = MujocoTrial(scene, make_station(), settings=settings)
    result = trial.run("box", CENTRE, friction=0.5)
    assert result.outcome is Outcome.LIFTED and result.touched == ""
    assert result.pushed["box"] < 1e-3
    begun_at_grasp = MujocoTrial(scene, make_station(), settings=replace(settings, approach=False))
    sooner = begun_at_grasp.run("box", CENTRE, friction=0.5)
    assert result.margins.pad_force == pytest.approx(sooner.margins.pad_force, rel=1e-3)
    way_in = settings.time_of(GraspMotion().standoff)
    assert result.margins.end_time > sooner.margins.end_time + way_in


def test_a_fatal_error_of_mujoco_is_an_outcome(make_scene) -> None:
    """An integrator that there is not; the next trial is as if nothing had happened."""
    trial = MujocoTrial(make_scene(("box", 0.3, 0.2, 0.0)), make_station())
    before = trial.run("box", CENTRE)
    option = trial.world.model.opt
    usual, option.integrator = option.integrator, 99
    result = trial.run("box", CENTRE)
    assert result.outcome is Outcome.SIMULATION_FAILED and "invalid integrator" in result.reason
    option.integrator = usual
    assert exact(trial.run("box", CENTRE)) == exact(before)


# --- refusals -------------------------------------------------------------------------------------


def test_an_engine_runs_its_own_trials(scene: Scene) -> None:
    with pytest.raises(InvalidInputError, match=r"'mujoco' .* the hand alone"):
        HandTrial(scene, make_station(), engine="mujoco")
    with pytest.raises(
        InvalidInputError, match="'standard' has simulator drake; a MujocoTrial needs"
    ):
        MujocoTrial(scene, make_station(), engine="standard")


def test_an_object_needs_convex_pieces(scene: Scene) -> None:
    document = scene.library.document
    bare = {
        n: replace(e, pieces=(), contact=replace(e.contact, kind="surface", primitive=None))
        for n, e in document.objects.items()
    }
    library = replace(scene.library, document=replace(document, objects=bare))
    with pytest.raises(InvalidInputError, match="object 'box' has no convex pieces"):
        MujocoTrial(replace(scene, library=library), make_station())


def test_a_piece_needs_a_volume(scene: Scene, tmp_path: Path) -> None:
    flat = trimesh.Trimesh([(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0)], [(0, 1, 2)], process=False)
    flat.export(tmp_path / "flat.obj")
    document = scene.library.document
    entry = replace(document.objects["box"], pieces=("flat.obj",))
    entry = replace(entry, contact=replace(entry.contact, kind="pieces", primitive=None))
    objects = {**document.objects, "box": entry}
    library = replace(scene.library, document=replace(document, objects=objects), root=tmp_path)
    with pytest.raises(InvalidInputError, match=r"piece flat.obj has no volume \(3 points\)"):
        check_objects(replace(scene, library=library))
