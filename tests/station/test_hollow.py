"""A mug with a rigid mesh for contact: a finger reaches into it, and so may another object."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import Outcome, Pose, make_pose, rot_z, swap_fingers
from burg_drake.grasping import HandClearance
from burg_drake.motion import ArmCollision
from burg_drake.objects import ObjectLibrary, contact_geometry, load_library, model_sdf
from burg_drake.scene import Instance, Scene, SceneDocument
from burg_drake.station import build_station_diagram, check_scene, find_overlaps, load_station

FLOOR = 0.0065
"""Just above the floor of the household mug [m]."""


def with_mesh(name: str, folder: Path) -> ObjectLibrary:
    """The household library with a rigid mesh as contact geometry of one object."""
    household = load_library("household")
    shutil.copytree(household.root, folder)
    entry = household.entry(name)
    contact = contact_geometry("mesh", household.surface(name), True, [], folder / name)
    pieces = [Path(p).relative_to(name).as_posix() for p in entry.pieces]
    text = model_sdf(name, entry.mass_properties, entry.friction, "mesh.obj", pieces, contact)
    (folder / entry.sdf).write_text(text)
    objects = {**household.objects, name: dataclasses.replace(entry, contact=contact)}
    return ObjectLibrary(dataclasses.replace(household.document, objects=objects), folder)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    folder = tmp_path_factory.mktemp("hollow")
    library = with_mesh("mug", folder / "library")
    instances = (
        Instance(object="mug", X_SO=Pose((0.25, 0.2, 0.0))),
        Instance(object="marble", X_SO=Pose((0.25, 0.2, FLOOR))),
    )
    document = SceneDocument(name="test", library="library", instances=instances)
    return Scene(document, library, folder / "scene.yaml")


def test_the_mesh_is_one_collision_geometry(scene: Scene) -> None:
    diagram = build_station_diagram(scene, load_station("panda_tabletop"), robot="none")
    body = diagram.plant.get_body(diagram.free["mug"])
    (geometry,) = diagram.plant.GetCollisionGeometriesForBody(body)
    shape = diagram.scene_graph.model_inspector().GetShape(geometry)
    assert type(shape).__name__ == "Mesh"


def test_an_object_may_stand_in_another(scene: Scene) -> None:
    diagram = build_station_diagram(scene, load_station("panda_tabletop"), robot="none")
    found = find_overlaps(diagram)
    assert not any(depth > 1e-4 for depth in found.values()), found
    assert check_scene(scene, load_station("panda_tabletop")) == ()


def test_a_finger_may_reach_in_but_not_into_the_wall(scene: Scene) -> None:
    diagram = build_station_diagram(scene, load_station("panda_tabletop"), robot="hand")
    clearance = HandClearance(diagram)
    radius, height = float(scene.entry("mug").upper[1]), float(scene.entry("mug").upper[2])
    down = make_pose(np.diag([1.0, -1.0, -1.0]))
    for angle in (np.pi / 2, np.pi, 4.0):  # the handle is at 0
        spoke = diagram.X_WO("mug") @ make_pose(rot_z(angle))
        across = spoke @ make_pose(p_AB=(radius - 0.002, 0.0, height - 0.015)) @ down
        for X_WG in (across, swap_fingers(across)):
            assert clearance.check("mug", X_WG).outcome is None
        through = spoke @ make_pose(p_AB=(radius + 0.04, 0.0, height - 0.015)) @ down
        assert clearance.check("mug", through).outcome is Outcome.COLLISION_TARGET


def test_the_arm_checker_sees_the_hole(scene: Scene) -> None:
    """The plant of the robot alone holds the pieces, which do not count as overlapping the table
    that they stand on."""
    diagram = build_station_diagram(
        scene, load_station("panda_tabletop"), robot="arm", weld_objects=True
    )
    collision = ArmCollision(diagram)
    arm = diagram.station.document.arm
    assert arm is not None and collision.is_free(np.array(arm.home))
    inspector = collision.checker.model_context().GetQueryObject().inspector()
    frame = diagram.plant.GetBodyFrameIdOrThrow(diagram.free["mug"])
    names = [
        type(inspector.GetShape(g)).__name__
        for g in inspector.GetGeometries(frame)
        if inspector.GetProximityProperties(g) is not None
    ]
    assert names == ["Convex"] * len(scene.entry("mug").pieces)
