"""What is settled stands still in the diagram that users get, and what is not is told to move."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from trial_world import GRAVITY, make_station

import burg_drake as burg
from burg_drake.core import InvalidInputError, Pose
from burg_drake.objects import load_library
from burg_drake.scene import Instance, Scene, SceneDocument
from burg_drake.simulation import (
    RELAXING_ENGINE,
    DriftLimits,
    is_still,
    measure_drift,
    predict_drift,
    reduce_friction,
    settle_scene,
)
from burg_drake.station import build_station_diagram, load_station

EDGE = 0.05
"""Of the blocks [m]."""


def placed(name: str, object: str, x: float, z: float, yaw: float = 0.0) -> Instance:
    return Instance(name=name, object=object, X_SO=Pose((x, 0.2, z), rpy_deg=(0.0, 0.0, yaw)))


@pytest.fixture(scope="module")
def heap(make_scene) -> Scene:
    """A block on a block, beside a can that lies on its side against a ball."""
    can = Instance(object="can", X_SO=Pose((0.45, 0.2, 0.031), rpy_deg=(90.0, 0.0, 0.0)))
    return make_scene(
        placed("low", "block", 0.2, 0.0005),
        placed("high", "block", 0.205, EDGE + 0.001, 15.0),
        can,
        placed("ball", "ball", 0.52, 0.0),
    )


def test_a_settled_heap_is_still(heap: Scene) -> None:
    settled = settle_scene(heap, make_station())
    assert settled.at_rest
    assert settled.scene.X_SO("high")[2, 3] == pytest.approx(EDGE, abs=3e-4)
    assert settled.displacements["ball"].distance < 1e-3
    moved = measure_drift(settled.scene, make_station(), duration=0.5)
    assert moved.keys() == heap.instances.keys()
    assert is_still(moved), moved
    again = settle_scene(heap, make_station())
    assert again.scene.document == settled.scene.document  # bit for bit


def test_what_is_in_the_air_falls(make_scene) -> None:
    scene = make_scene(placed("block", "block", 0.3, 0.5))
    moved = measure_drift(scene, make_station(), duration=0.1)
    assert not is_still(moved)
    assert moved["block"].distance == pytest.approx(GRAVITY * 0.1**2 / 2, rel=0.02)
    assert moved["block"].angle == pytest.approx(0.0, abs=1e-6)
    low = make_scene(placed("block", "block", 0.3, 0.002))
    assert measure_drift(low, make_station(), duration=0.5)["block"].distance > 1.9e-3


def test_what_will_not_stay_is_foretold(make_scene) -> None:
    """A block that is tilted by 1 degree falls back onto its face; one that stands on it stays."""
    tilted = Instance(name="tilted", object="block", X_SO=Pose((0.4, 0.2, 0), rpy_deg=(1.0, 0, 0)))
    scene = make_scene(placed("block", "block", 0.3, 0.0), tilted)
    built = build_station_diagram(scene, make_station(), robot="none", engine=RELAXING_ENGINE)
    moving = predict_drift(built).moving
    assert list(moving) == ["tilted"]
    assert moving["tilted"].turning > DriftLimits.angle / DriftLimits.duration


def test_what_is_known_to_stay_is_not_looked_at(make_scene) -> None:
    """Of two tilted blocks far apart and one in contact with the first: a tilted one alone is let
    go, or with what touches it."""
    tilt = (1.0, 0.0, 0.0)
    one = Instance(name="one", object="block", X_SO=Pose((0.4, 0.2, 0.0), rpy_deg=tilt))
    other = Instance(name="other", object="block", X_SO=Pose((0.2, 0.2, 0.0), rpy_deg=tilt))
    scene = make_scene(one, other, placed("beside", "block", 0.4 + EDGE + 2e-4, 0.0))
    built = build_station_diagram(scene, make_station(), robot="none", engine=RELAXING_ENGINE)
    foretold = predict_drift(built, among=["one"])
    assert list(foretold.moving) == ["one"]
    assert foretold.doubtful == {"one", "beside"}
    assert foretold.X_WO.keys() == scene.instances.keys()
    assert (foretold.X_WO["other"] == built.X_WO("other")).all()
    assert foretold.relative_speed == pytest.approx(
        foretold.moving["one"].turning * 5.0 / DriftLimits.angle
    )
    assert predict_drift(built, among=["other"]).moving.keys() == {"other"}


def test_what_rocks_until_it_rests_is_no_creep() -> None:
    """A banana that is tilted by 0.02 degrees from where it rests."""
    place = Pose((0.199992, 0.199985, -0.000604), rpy_deg=(-1.856, 0.0759, -0.0287))
    banana = Instance(object="banana", X_SO=place)
    document = SceneDocument(name="banana", library="household", instances=(banana,))
    scene = Scene(document, load_library("household"), Path("banana.yaml"))
    station = load_station("panda_tabletop")
    built = build_station_diagram(scene, station, robot="none", engine=RELAXING_ENGINE)
    assert predict_drift(built, once=True).moving  # as far as one can tell so soon
    assert not predict_drift(built).moving
    assert is_still(measure_drift(scene, station, duration=1.0))


def test_friction_is_slackened(make_scene) -> None:
    scene = make_scene(placed("block", "block", 0.3, 0.0))
    built = build_station_diagram(scene, make_station(), robot="none", engine=RELAXING_ENGINE)
    reduce_friction(built, 0.25)
    inspector = built.scene_graph.model_inspector()
    body = built.plant.get_body(built.free["block"])
    for geometry in built.plant.GetCollisionGeometriesForBody(body):
        properties = inspector.GetProximityProperties(geometry)
        friction = properties.GetProperty("material", "coulomb_friction")
        assert friction.dynamic_friction() == pytest.approx(scene.entry("block").friction / 4)


def test_a_duration_that_is_none(heap: Scene) -> None:
    for duration in (0.0, np.nan):
        with pytest.raises(InvalidInputError, match="give more than 0"):
            measure_drift(heap, make_station(), duration=duration)


def test_the_earlier_name_still_works() -> None:
    with pytest.warns(DeprecationWarning, match="measure_drift since 0.1"):
        assert burg.scenes.stillness is burg.scenes.measure_drift
