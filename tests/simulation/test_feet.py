"""Objects stand, tip, slide and roll on their feet as statics and dynamics say."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydrake.geometry import Cylinder
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context
from trial_world import BOX, GRAVITY, make_station

from burg_drake.core import Array, Pose, make_pose, rot_z, rotation_from_rpy
from burg_drake.objects import HULL_TOLERANCE, MAX_CARRYING_CORNERS, support_feet
from burg_drake.pipeline import ObjectSource, build_library
from burg_drake.scene import Instance, Scene, SceneDocument, load_scene, save_scene
from burg_drake.station import StationDiagram, build_station_diagram, load_station

MakeScene = Callable[..., Scene]
CAN_RADIUS = 0.03
THIN = 0.0024
"""Of a wire, and of a sheet [m]."""


def on_feet(scene: Scene, engine: str = "standard") -> StationDiagram:
    """A scene whose objects have feet."""
    return build_station_diagram(
        scene, make_station(), robot="none", engine=engine, for_trials=True
    )


def started(built: StationDiagram) -> tuple[Simulator, Context]:
    """A simulator, and the plant's part of its Context."""
    simulator = Simulator(built.diagram)
    return simulator, built.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())


def friction(built: StationDiagram, name: str) -> float:
    """Drake's combination of an object's coefficient with the table's."""
    mu, table = built.scene.entry(name).friction, built.station.document.table.friction
    return 2.0 * mu * table / (mu + table)


@pytest.mark.parametrize(
    ("heading", "engine"),
    [
        (0.0, "standard"),
        (0.25 * np.pi, "standard"),
        (0.5 * np.pi, "standard"),
        (0.25 * np.pi, "screening"),
    ],
)
def test_a_thrown_brick_slides_as_far_as_coulomb_says(
    make_scene: MakeScene, heading: float, engine: str
) -> None:
    """Less what the time step takes: v dt / 2, as it brakes from the first step on."""
    built = on_feet(make_scene(("wide", 0.3, 0.2, 20.0)), engine)
    simulator, context = started(built)
    brick = built.plant.get_body(built.free["wide"])
    simulator.AdvanceTo(0.1)
    start = built.plant.EvalBodyPoseInWorld(context, brick).translation()
    speed = 0.4
    throw = SpatialVelocity(np.zeros(3), speed * np.array((np.cos(heading), np.sin(heading), 0.0)))
    built.plant.SetFreeBodySpatialVelocity(context=context, body=brick, V_JpJc=throw)
    simulator.AdvanceTo(0.6)
    way = built.plant.EvalBodyPoseInWorld(context, brick).translation() - start
    ideal = speed**2 / (2.0 * friction(built, "wide") * GRAVITY)
    ideal -= speed * built.engine.time_step / 2.0
    assert np.linalg.norm(way[:2]) == pytest.approx(ideal, rel=0.01)
    assert np.arctan2(way[1], way[0]) == pytest.approx(heading, abs=0.01)


@pytest.mark.parametrize(("share", "falls"), [(0.98, False), (1.02, True)])
@pytest.mark.parametrize("side", ["along", "across"])
def test_a_leaning_box_falls_over_where_its_weight_is_past_the_edge(
    make_scene: MakeScene, share: float, falls: bool, side: str
) -> None:
    half = BOX[1 if side == "along" else 0] / 2.0
    built = on_feet(make_scene(("box", 0.3, 0.2, 0.0)))
    simulator, context = started(built)
    box = built.plant.get_body(built.free["box"])
    lean = share * np.arctan2(half, BOX[2] / 2.0)
    rpy, edge = ([-lean, 0.0, 0.0], (0.0, half, 0.0)) if side == "along" else (
        [0.0, lean, 0.0], (half, 0.0, 0.0)
    )  # fmt: skip
    R = rotation_from_rpy(rpy)
    X_WO = make_pose(R, np.array((0.3, 0.2, 0.0)) - R @ edge)
    built.plant.SetFloatingBaseBodyPoseInWorldFrame(context, box, RigidTransform(X_WO))
    simulator.AdvanceTo(1.2)
    upright = built.plant.EvalBodyPoseInWorld(context, box).rotation().matrix()[2, 2]
    assert (upright < 0.5) == falls


def test_a_can_rolls_on_and_stands_still(make_scene: MakeScene) -> None:
    lying = Instance(object="can", X_SO=Pose((0.35, 0.2, CAN_RADIUS), rpy_deg=(90.0, 0.0, 0.0)))
    upright = Instance(object="can", name="upright", X_SO=Pose((0.1, 0.2, 0.0)))
    built = on_feet(make_scene(lying, upright))
    simulator, context = started(built)
    rolling = built.plant.get_body(built.free["can"])
    standing = built.plant.get_body(built.free["upright"])
    speed = 0.2
    roll = SpatialVelocity(w=np.array((0.0, speed / CAN_RADIUS, 0.0)), v=np.array((speed, 0, 0)))
    built.plant.SetFreeBodySpatialVelocity(context=context, body=rolling, V_JpJc=roll)
    start = built.plant.EvalBodyPoseInWorld(context, rolling).translation()
    still = built.plant.EvalBodyPoseInWorld(context, standing).GetAsMatrix4()
    simulator.AdvanceTo(0.5)
    way = built.plant.EvalBodyPoseInWorld(context, rolling).translation() - start
    assert way[0] == pytest.approx(0.5 * speed, rel=0.02)
    assert np.abs(way[1:]).max() < 5e-4
    after = built.plant.EvalBodyPoseInWorld(context, standing).GetAsMatrix4()
    assert np.abs(after - still).max() < 5e-5


def test_feet_do_not_depend_on_where_an_object_points() -> None:
    """A hexagonal prism, whose corners are all alike."""
    corners = prism(6, 0.03, 0.08)
    up = np.array((0.0, 0.0, 1.0))
    feet = support_feet(corners, [up])
    for angle in (0.3, 1.1, 2.0):
        X_WO = rot_z(angle) @ rotation_from_rpy([0.0, 0.0, 0.7])
        assert (support_feet(corners, [X_WO[2]]) == feet).all()


def test_feet_carry_in_all_poses_and_hold_the_hull_elsewhere() -> None:
    corners = prism(48, 0.04, 0.10)
    up = np.array((0.0, 0.0, 1.0))
    feet = corners[support_feet(corners, [up])]
    standing = feet[feet[:, 2] < 1e-9]
    assert len(standing) >= MAX_CARRYING_CORNERS
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    missing = (corners @ directions.T).max(axis=0) - (feet @ directions.T).max(axis=0)
    assert missing.max() < 1.3 * HULL_TOLERANCE
    ring = np.stack([np.cos(np.arange(48)), np.sin(np.arange(48)), np.zeros(48)], axis=1)
    assert (standing @ ring.T).max(axis=0).min() > 0.96 * 0.04
    assert len(feet) < len(corners) / 2


def test_built_in_objects_stand_where_scenes_place_them() -> None:
    """Settling has left some of them a fraction of a millimetre in the table."""
    scene = load_scene("tabletop_six")
    station = load_station("panda_tabletop")
    built = build_station_diagram(scene, station, robot="none", engine="standard", for_trials=True)
    simulator, context = started(built)
    simulator.AdvanceTo(0.3)
    for name, index in built.free.items():
        X_WO = built.plant.EvalBodyPoseInWorld(context, built.plant.get_body(index)).GetAsMatrix4()
        assert np.abs(X_WO - built.X_WO(name)).max() < 2e-3, name


def test_what_stands_at_the_edge_of_the_table_keeps_its_pieces(make_scene: MakeScene) -> None:
    """Feet that are over nothing are no support."""
    built = on_feet(make_scene(("box", 0.3 + 1.5 - 0.02, 0.2, 0.0)))
    assert not built.parts.feet
    simulator, context = started(built)
    simulator.AdvanceTo(0.3)
    box = built.plant.get_body(built.free["box"])
    assert built.plant.EvalBodyPoseInWorld(context, box).translation()[2] > -1e-3


def test_what_is_thinner_than_it_is_sunk_keeps_half_of_itself(tmp_path: Path) -> None:
    wire = trimesh.creation.cylinder(radius=THIN / 2, height=0.04, sections=48)
    sheet = trimesh.creation.box((0.05, 0.03, THIN))
    sources = [
        ObjectSource(name=name, mesh=mesh, mass=0.001, pieces=(mesh,), contact=contact)
        for name, mesh, contact in (
            ("wire", wire, "primitive"),
            ("sheet", sheet, "primitive"),
            ("card", sheet, "pieces"),
        )
    ]
    assert not build_library(sources, tmp_path / "library", confirm=False).failed
    lying = {"wire": (90.0, 0.0, 0.0), "sheet": (0.0, 0.0, 0.0), "card": (0.0, 0.0, 0.0)}
    instances = tuple(
        Instance(object=name, X_SO=Pose((0.1 * k + 0.1, 0.2, THIN / 2 - 0.0015), rpy_deg=rpy))
        for k, (name, rpy) in enumerate(lying.items())
    )
    document = SceneDocument(name="thin", library="library", instances=instances)
    save_scene(document, tmp_path / "scene.yaml")
    built = on_feet(load_scene(tmp_path / "scene.yaml"))
    inspector = built.scene_graph.model_inspector()
    for name, index in built.free.items():
        own = built.plant.GetCollisionGeometriesForBody(built.plant.get_body(index))
        feet = [g for g in own if g in built.parts.feet]
        discs = [shape for g in feet if isinstance(shape := inspector.GetShape(g), Cylinder)]
        assert len(discs) == (2 if name == "wire" else 0)
        assert all(disc.radius() >= 0.24 * THIN for disc in discs)
        up = built.X_WO(name)[2, :3]
        heights = [inspector.GetPoseInFrame(g).translation() @ up for g in feet]
        assert min(heights) <= 1e-6, name  # no higher than the middle
        assert name == "card" or max(heights) - min(heights) >= 0.49 * THIN, name


def test_feet_meet_the_table_alone_and_balls_have_none(make_scene: MakeScene) -> None:
    built = on_feet(make_scene(("box", 0.2, 0.2, 0.0), ("ball", 0.4, 0.2, 0.0)))
    inspector = built.scene_graph.model_inspector()
    box, ball, table = (
        built.plant.GetCollisionGeometriesForBody(built.plant.get_body(index))
        for index in (built.free["box"], built.free["ball"], built.table)
    )
    assert built.parts.feet and set(built.parts.feet) < set(box)
    for foot in built.parts.feet:
        assert all(inspector.CollisionFiltered(foot, other) for other in ball)
        assert not any(inspector.CollisionFiltered(foot, other) for other in table)


def prism(sides: int, radius: float, height: float) -> Array:
    """Corners (2 N, 3) of a prism that stands on z = 0 [m]."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    ends = [np.column_stack([ring, np.full(sides, z)]) for z in (0.0, height)]
    return np.vstack(ends)
