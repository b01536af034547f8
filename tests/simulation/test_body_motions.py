"""How far other objects were moved: the farthest point of each, its rotation, and what lies."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix
from trial_world import BOX, POST, QUICK, from_above, make_station

from burg_drake.core import Array, Outcome, Pose, rotation_angle
from burg_drake.scene import Instance, Scene
from burg_drake.simulation import HandTrial, MotionTracker

BAR = (0.03, 0.30)
"""Size of the bar on the table [m]."""


class Moved:
    """One object of a scene that is put where it shall be, watched from where it stands."""

    def __init__(self, scene: Scene, name: str) -> None:
        self.world = HandTrial(scene, make_station(), engine=QUICK).complete_world
        self.plant = self.world.diagram.plant
        self.context = self.plant.GetMyMutableContextFromRoot(self.world.context)
        self.index = self.world.diagram.free[name]
        self.bodies = {name: self.index}
        self.tracker = MotionTracker(self.world, [self.index])

    def turn(self, R_W: RotationMatrix, p_WQ: tuple[float, float, float], up: float = 0.0) -> float:
        """Turns it about a point and moves it up, and measures."""
        X_WO = RigidTransform(self.world.diagram.X_WO(next(iter(self.bodies))))
        X_W = RigidTransform(p_WQ) @ RigidTransform(R_W) @ RigidTransform(-np.array(p_WQ))
        X_W = RigidTransform((0.0, 0.0, up)) @ X_W
        body = self.plant.get_body(self.index)
        self.plant.SetFloatingBaseBodyPoseInWorldFrame(self.context, body, X_W @ X_WO)
        return self.tracker.update(set())


@pytest.mark.parametrize("angle", np.deg2rad([1e-4, 8.4, 90.0, 180.0]))
def test_the_tip_of_a_bar_that_turns_about_a_corner(
    make_scene: Callable[..., Scene], angle: float
) -> None:
    """It moves by the chord of its way; the centre of mass by half of that."""
    bar = Moved(make_scene(("bar", 0.3, 0.2, 0.0)), "bar")
    by_mass = bar.turn(RotationMatrix.MakeZRotation(angle), (0.3 - BAR[0] / 2, 0.2 - BAR[1] / 2, 0))
    chord = 2.0 * np.hypot(*BAR) * np.sin(angle / 2.0)
    assert bar.tracker.farthest[bar.index] == pytest.approx(chord, rel=1e-6)
    assert by_mass == pytest.approx(chord / 2.0, rel=1e-6)
    assert bar.tracker.turned[bar.index] == pytest.approx(angle, rel=1e-6)
    bar.turn(RotationMatrix(), (0, 0, 0))  # back where it was: the farthest counts
    assert bar.tracker.farthest[bar.index] == pytest.approx(chord, rel=1e-6)


@pytest.mark.parametrize(("degrees", "lies"), [(44.0, False), (46.0, True), (180.0, True)])
@pytest.mark.parametrize("heading", [0.0, 1.0, 4.0])
def test_what_lies_is_tilted_by_more_than_45_degrees(
    make_scene: Callable[..., Scene], degrees: float, lies: bool, heading: float
) -> None:
    """A post that is turned over ends as high as it began, but was not on the way."""
    post = Moved(make_scene(("post", 0.3, 0.2, 30.0)), "post")
    about = RotationMatrix.MakeZRotation(heading)
    for angle in np.deg2rad(np.linspace(0.0, degrees, 5)):
        tilt = about @ RotationMatrix.MakeXRotation(angle) @ about.inverse()
        post.turn(tilt @ RotationMatrix.MakeZRotation(2.0), (0.3, 0.2, POST[2]))
    assert post.tracker.toppled(post.bodies) == (["post"] if lies else [])


LYING = Pose((0.3, 0.2, 0.03), rpy_deg=(90.0, 0.0, 20.0))
"""A can on its side [m, deg]."""


@pytest.mark.parametrize("degrees", [50.0, 90.0, 180.0, 270.0])
@pytest.mark.parametrize("below", [0.0, -0.08])
def test_what_rolls_has_not_toppled(
    make_scene: Callable[..., Scene], degrees: float, below: float
) -> None:
    """Nor if it rolls off something, and comes to rest lower down."""
    ball = Moved(make_scene(("ball", 0.3, 0.2, 0.0)), "ball")
    can = Moved(make_scene(Instance(object="can", X_SO=LYING)), "can")
    axis_W = can.world.X_WB(can.index)[:3, 2]
    for thing in (ball, can):
        for angle in np.deg2rad(np.linspace(0.0, degrees, 10)):
            roll = RotationMatrix(AngleAxis(angle, axis_W))
            thing.turn(roll, (0.3, 0.2, 0.03), up=below * angle)
        assert thing.tracker.turned[thing.index] > np.deg2rad(45.0)
        assert thing.tracker.toppled(thing.bodies) == []


def test_a_cube_that_falls_onto_another_side_has_toppled(make_scene: Callable[..., Scene]) -> None:
    """It is as high as before in the end, but not on its edge."""
    cube = Moved(make_scene(("block", 0.3, 0.2, 0.0)), "block")
    for angle in np.linspace(0.0, np.pi / 2.0, 10):
        cube.turn(RotationMatrix.MakeXRotation(angle), (0.3, 0.2, 0.0))
    assert cube.tracker.toppled(cube.bodies) == ["block"]


@pytest.fixture(scope="module")
def pushed_bar(make_scene: Callable[..., Scene]) -> HandTrial:
    """The box stands 2 mm beside the last 5 mm of a bar, and is pushed against it by 6 mm."""
    scene = make_scene(("box", 0.3, 0.2, 0.0), ("bar", 0.347, 0.39, 0.0), ("block", 0.1, 0.35, 0.0))
    return HandTrial(scene, make_station(), engine=QUICK)


def test_a_bar_that_is_pushed_at_one_end(pushed_bar: HandTrial) -> None:
    """Against the corners of its mesh where the trial leaves it, and the gap that closes."""
    result = pushed_bar.run("box", from_above(0.065, x=0.006))
    world = pushed_bar.world
    plant, scene = world.diagram.plant, world.diagram.scene
    X_WO = plant.EvalBodyPoseInWorld(
        plant.GetMyContextFromRoot(world.context), plant.get_body(world.diagram.free["bar"])
    ).GetAsMatrix4()
    start = world.diagram.X_WO("bar")
    corners = np.asarray(scene.library.mesh(scene.entry("bar").mesh).vertices)
    way = _placed(X_WO, corners) - _placed(start, corners)
    moved = result.displacements["bar"]
    assert moved == pytest.approx(np.linalg.norm(way, axis=1).max(), abs=1e-4)
    assert moved == result.margins.others_moved == pytest.approx(0.004, abs=5e-4)
    center = np.append(scene.entry("bar").mass_properties.center_of_mass, 1.0)
    assert np.linalg.norm(X_WO @ center - start @ center) < 0.5 * moved
    angle = float(rotation_angle(X_WO[:3, :3] @ start[:3, :3].T))
    assert result.turned["bar"] == result.margins.others_turned == pytest.approx(angle, abs=1e-3)
    assert angle > 0.005
    assert (result.displacements["block"], result.turned["block"]) == (0.0, 0.0)
    assert (result.outcome, result.toppled) == (Outcome.LIFTED, "")


def test_a_neighbour_that_falls_over_is_named(make_scene: Callable[..., Scene]) -> None:
    """A post stands at the edge of the box, and falls when that is lifted."""
    on_top = Instance(object="post", X_SO=Pose((0.3, 0.243, BOX[2])))
    scene = make_scene(("box", 0.3, 0.2, 0.0), on_top, ("block", 0.1, 0.35, 0.0))
    trial = HandTrial(scene, make_station(), engine=QUICK)
    result = trial.run("box", from_above(0.05, y=-0.03), friction=0.8)
    assert result.toppled == "post"
    assert result.displacements["post"] > POST[2] / 2


def test_a_neighbour_that_rolls_is_not_named(make_scene: Callable[..., Scene]) -> None:
    """Ball and can are pushed by the box, which the closing fingers move by 6 mm."""
    can = Instance(object="can", X_SO=Pose((0.361, 0.19, 0.03), rpy_deg=(90.0, 0.0, 0.0)))
    scene = make_scene(("box", 0.3, 0.2, 0.0), ("ball", 0.361, 0.23, 0.0), can)
    trial = HandTrial(scene, make_station(), engine=QUICK)
    result = trial.run("box", from_above(0.065, x=0.006))
    free = trial.world.diagram.free
    for name in ("ball", "can"):
        tilted = trial.world.X_WB(free[name])[2, :3] @ trial.world.diagram.X_WO(name)[2, :3]
        assert tilted < np.cos(np.deg2rad(45.0)), name
    assert result.toppled == ""


def _placed(X_WO: Array, p_OQ: Array) -> Array:
    return p_OQ @ X_WO[:3, :3].T + X_WO[:3, 3]
