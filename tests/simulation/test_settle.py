"""Settling against free fall and statics."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator

from burg_drake.core import Pose
from burg_drake.objects import load_library
from burg_drake.scene import Instance, Scene, SceneDocument
from burg_drake.simulation import settle
from burg_drake.station import StationDiagram, build_station_diagram, load_station

GRAVITY = 9.81


@pytest.fixture(scope="module")
def built() -> StationDiagram:
    """Two boxes that stand where the documents place them, at rest."""
    library = load_library("household")
    instances = tuple(
        Instance(name=name, object="box", X_SO=Pose((x, 0.2, 0.0)))
        for name, x in (("near", 0.1), ("far", 0.4))
    )
    document = SceneDocument(name="boxes", library="household", instances=instances)
    scene = Scene(document, library, Path("boxes.yaml"))
    return build_station_diagram(scene, load_station("panda_tabletop"), robot="none")


def start(built: StationDiagram, far_z: float) -> Simulator:
    context = built.diagram.CreateDefaultContext()
    plant_context = built.plant.GetMyMutableContextFromRoot(context)
    far = built.plant.get_body(built.free["far"])
    X_WO = RigidTransform(built.X_WO("far"))
    x, y, z = X_WO.translation()
    X_WO.set_translation([x, y, z + far_z])
    built.plant.SetFloatingBaseBodyPoseInWorldFrame(plant_context, far, X_WO)
    return Simulator(built.diagram, context)


def test_what_rests_is_at_rest_at_once(built: StationDiagram) -> None:
    settled = settle(start(built, 0.0), built.plant, built.free.values(), 2.0)
    assert settled.at_rest
    assert settled.duration < 0.5


def test_what_falls_is_named_with_its_speed(built: StationDiagram) -> None:
    """The mean speed of the last poll interval is that of free fall at its middle."""
    settled = settle(start(built, 0.5), built.plant, built.free.values(), 0.2)
    assert not settled.at_rest
    assert list(settled.moving) == [built.free["far"]]
    speed = settled.moving[built.free["far"]]
    assert speed.speed == pytest.approx(GRAVITY * 0.18, rel=0.02)
    assert speed.turning == pytest.approx(0.0, abs=1e-6)
    assert settled.duration == pytest.approx(0.2)


def test_only_what_is_watched_counts(built: StationDiagram) -> None:
    assert settle(start(built, 0.5), built.plant, [built.free["near"]], 0.2).at_rest
