"""Objects whose contact geometry is a primitive: they rest, and the screen measures them right."""

from __future__ import annotations

import dataclasses
import shutil

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from burg_drake.core import (
    Outcome,
    Pose,
    make_pose,
    rotation_angle,
    rotation_from_rpy,
    swap_fingers,
)
from burg_drake.grasping import HandClearance
from burg_drake.objects import ObjectLibrary, contact_geometry, load_library, model_sdf
from burg_drake.scene import Instance, Scene, SceneDocument
from burg_drake.station import build_station_diagram, find_overlaps, load_station

CAN, LYING = (0.2, 0.2), (0.4, 0.1)
RADIUS, HEIGHT, BALL = 0.034, 0.102, 0.015
"""Of the household can and marble [m]."""


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """A can that stands, one that lies, a marble, and a box."""
    folder = tmp_path_factory.mktemp("primitives")
    household = load_library("household")
    shutil.copytree(household.root, folder / "library")
    objects = {}
    for name in ("can", "marble", "box"):
        entry, surface = household.entry(name), household.surface(name)
        contact = contact_geometry("primitive", surface, True, [], folder)
        text = model_sdf(name, entry.mass_properties, entry.friction, "mesh.obj", [], contact)
        (folder / "library" / entry.sdf).write_text(text)
        objects[name] = dataclasses.replace(entry, contact=contact)
    library = ObjectLibrary(
        dataclasses.replace(household.document, objects=objects), folder / "library"
    )
    lying = make_pose(rotation_from_rpy((np.pi / 2, 0.0, 0.0)), (*LYING, RADIUS))
    instances = (
        Instance(object="can", X_SO=Pose((*CAN, 0.0))),
        Instance(name="lying", object="can", X_SO=Pose.from_matrix(lying)),
        Instance(object="marble", X_SO=Pose((0.3, 0.3, 0.0))),
        Instance(object="box", X_SO=Pose((0.5, 0.3, 0.0))),
    )
    document = SceneDocument(name="test", library="library", instances=instances)
    return Scene(document, library, folder / "scene.yaml")


def test_nothing_overlaps_on_the_table(scene: Scene) -> None:
    diagram = build_station_diagram(scene, load_station("panda_tabletop"), robot="none")
    found = find_overlaps(diagram)
    assert not any(depth > 1e-6 for depth in found.values()), found


@pytest.mark.thorough
def test_they_come_to_rest_where_they_are(scene: Scene) -> None:
    """Nothing wobbles, rolls away, or sinks in by more than facets and the table's give; what lies
    may rock on the nearest of Drake's facets, of which there are 26."""
    diagram = build_station_diagram(scene, load_station("panda_tabletop"), robot="none")
    simulator = Simulator(diagram.diagram)
    plant = diagram.plant
    context = plant.GetMyContextFromRoot(simulator.get_context())
    simulator.AdvanceTo(2.0)
    for name, index in diagram.free.items():
        body = plant.get_body(index)
        X_WO, before = plant.EvalBodyPoseInWorld(context, body).GetAsMatrix4(), diagram.X_WO(name)
        moved = X_WO[:3, 3] - before[:3, 3]
        assert -9e-4 < moved[2] < 1e-5, name
        turned = float(rotation_angle(before[:3, :3].T @ X_WO[:3, :3]))
        roll = np.pi / 26 if name == "lying" else np.deg2rad(0.6)
        assert turned < 1.05 * roll, name
        assert np.linalg.norm(moved[:2]) < 5e-4 + RADIUS * turned, name
        V_WO = plant.EvalBodySpatialVelocityInWorld(context, body)
        assert np.linalg.norm(V_WO.translational()) < (3e-3 if name == "lying" else 1e-4), name


def test_screen_is_right_beside_a_can_and_a_marble(scene: Scene) -> None:
    """Verdict and depth of a pad that is pushed into the side of the can, and of the hand over
    the marble, both ways round."""
    diagram = build_station_diagram(scene, load_station("panda_tabletop"), robot="hand")
    clearance = HandClearance(diagram)
    down = np.diag([1.0, -1.0, -1.0])
    for angle in (0.0, 0.4, 1.3, -2.0):
        R = rotation_from_rpy((0.0, 0.0, angle)) @ down
        closing = R[:, 0]
        for offset, clear in ((0.0, True), (0.0055, True), (0.0065, False), (0.009, False)):
            X_SG = make_pose(R, (*CAN, HEIGHT - 0.02) + offset * closing)
            X_WG = diagram.station.document.X_WS.matrix() @ X_SG
            both = [clearance.check("can", X) for X in (X_WG, swap_fingers(X_WG))]
            assert [v.outcome is None for v in both] == [clear, clear]
            if not clear:
                assert both[0].outcome is Outcome.COLLISION_TARGET
                assert both[0].overlap == pytest.approx(offset - 0.006, abs=2e-5)
                assert both[1].overlap == pytest.approx(both[0].overlap, abs=1e-7)
    # the middle of the marble is this much nearer to one pad than half the opening
    for offset, clear in ((0.0, True), (0.0245, True), (0.026, False)):
        X_SG = make_pose(down, (0.3 + offset, 0.3, BALL))
        X_WG = diagram.station.document.X_WS.matrix() @ X_SG
        verdict = clearance.check("marble", X_WG)
        assert (verdict.outcome is None) == clear
        if not clear:
            assert verdict.overlap == pytest.approx(offset + BALL - 0.04, abs=1e-6)
