"""What a camera sees of objects, in scenes in which that is known."""

from __future__ import annotations

from dataclasses import replace

import pytest

from burg_drake.cameras import visible_from
from burg_drake.core import Pose, UnknownNameError
from burg_drake.scene import Scene
from burg_drake.station import Camera, Obstacle, Station, load_station
from tests.evaluation.composed import composed

CAN = composed(("can", "can", 0.3, 0.21, 0.0))
HEIGHT = 1.5


def looking_down(scene: Scene, *, focal: float = 600.0, **obstacles: Obstacle) -> Station:
    """The Panda's table with a camera over the first object, its axis on the object's."""
    station = load_station("panda_tabletop")
    name = next(iter(scene.instances))
    x, y, _ = (station.document.X_WS.matrix() @ scene.X_SO(name))[:3, 3]
    above = Camera(X_WC=Pose((x, y, HEIGHT), rpy_deg=(180.0, 0.0, 0.0)), focal=(focal, focal))
    document = replace(station.document, cameras={"above": above}, background=obstacles)
    return replace(station, document=document)


def shifted(station: Station, pixels: float) -> Station:
    """The principal point moved to the right, with all that is seen."""
    camera = station.document.cameras["above"]
    x, y = camera.principal_point
    cameras = {"above": replace(camera, center=(x + pixels, y))}
    return replace(station, document=replace(station.document, cameras=cameras))


def test_all_and_half_of_a_can() -> None:
    """In the middle of the image; with its axis on the image's edge; and beyond it."""
    station = looking_down(CAN)
    assert visible_from(CAN, station, "above") == {"can": 1.0}
    assert visible_from(CAN, shifted(station, 320.0), "above")["can"] == pytest.approx(
        0.5, abs=0.01
    )
    assert visible_from(CAN, shifted(station, 400.0), "above") == {"can": 0.0}


def test_an_obstacle_hides_a_half() -> None:
    """A slab above the can whose edge lies in the plane through its axis."""
    x, y, _ = (looking_down(CAN).document.X_WS.matrix() @ CAN.X_SO("can"))[:3, 3]
    slab = Obstacle(X_WB=Pose((x + 0.2, y, 0.5)), size=(0.4, 1.0, 0.01))
    station = looking_down(CAN, slab=slab)
    assert visible_from(CAN, station, "above")["can"] == pytest.approx(0.5, abs=0.01)


def test_a_camera_below_the_table_sees_nothing() -> None:
    station = looking_down(CAN)
    camera = station.document.cameras["above"]
    x, y, _ = camera.X_WC.translation
    below = replace(camera, X_WC=Pose((x, y, -HEIGHT), rpy_deg=(0.0, 0.0, 0.0)))
    away = replace(camera, X_WC=Pose((x, y, HEIGHT), rpy_deg=(0.0, 0.0, 0.0)))
    document = replace(station.document, cameras={"below": below, "away": away})
    station = replace(station, document=document)
    assert visible_from(CAN, station, "below") == {"can": 0.0}
    assert visible_from(CAN, station, "away") == {"can": 0.0}


def test_objects_hide_each_other() -> None:
    """A marble in front of, then behind a box, for a camera that looks along the table."""
    station = load_station("panda_tabletop")
    X_WS = station.document.X_WS.matrix()
    for y, expected in ((0.1, 1.0), (0.35, 0.0)):
        scene = composed(("box", "box", 0.3, 0.21, 90.0), ("marble", "marble", 0.3, y, 0.0))
        X_SC = Pose((0.3, -1.0, 0.05), rpy_deg=(-90.0, 0.0, 0.0)).matrix()
        camera = Camera(X_WC=Pose.from_matrix(X_WS @ X_SC))
        document = replace(station.document, cameras={"front": camera})
        seen = visible_from(scene, replace(station, document=document), "front")
        assert seen["marble"] == pytest.approx(expected, abs=0.01)
        assert (seen["box"] < 1.0) == (y == 0.1)


def test_no_such_camera() -> None:
    with pytest.raises(UnknownNameError, match="has no camera 'bord'; did you mean 'board'"):
        visible_from(CAN, load_station("panda_tabletop"), "bord")
