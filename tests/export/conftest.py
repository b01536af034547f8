"""A scene with all that an export has to carry, exported once to every format and moved away."""

from __future__ import annotations

import shutil
from dataclasses import replace

import pytest

from burg_drake.core import Array, Pose
from burg_drake.export import SCENE_FORMATS, Exported, export_scene
from burg_drake.objects import ContactGeometry, load_library
from burg_drake.scene import Board, Instance, Scene, SceneDocument
from burg_drake.station import Station, load_station

INSTANCES = (
    Instance(object="mug", X_SO=Pose((0.12, 0.11, 0.0), rpy_deg=(0.0, 0.0, 140.0))),
    Instance(object="can", X_SO=Pose((0.30, 0.10, 0.0))),
    Instance(object="box", X_SO=Pose((0.47, 0.11, 0.0), rpy_deg=(0.0, 0.0, 75.0))),
    Instance(name="2-can.b", object="can", X_SO=Pose((0.30, 0.30, 0.102), rpy_deg=(180, 0, 33))),
)
FIXED = Instance(name="bowl", object="bowl", X_SO=Pose((0.1, 0.3, 0.15), rpy_deg=(20, 30, 40)))
"""In the air and tilted, where nothing free would stay."""


@pytest.fixture(scope="session")
def station() -> Station:
    """With obstacles, and a board that is turned in the world."""
    return load_station("panda_shelf")


@pytest.fixture(scope="session")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    library = load_library("household")
    box = library.entry("box")
    as_mesh = replace(box, contact=ContactGeometry(kind="mesh", mesh=box.mesh))
    objects = {**library.objects, "box": as_mesh}
    document = SceneDocument(
        name="all", library="household", board=Board(), instances=INSTANCES, background=(FIXED,)
    )
    changed = replace(library, document=replace(library.document, objects=objects))
    return Scene(document, changed, tmp_path_factory.mktemp("scene") / "all.yaml")


@pytest.fixture(scope="session")
def exports(
    scene: Scene, station: Station, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Exported]:
    """By format; the folders are no longer where they were written."""
    written, moved = tmp_path_factory.mktemp("written"), tmp_path_factory.mktemp("moved")
    found = {}
    for to in SCENE_FORMATS:
        exported = export_scene(scene, written / to, to, station)
        shutil.move(written / to, moved / to)
        found[to] = replace(exported, main=moved / to / exported.main.name)
    return found


@pytest.fixture(scope="session")
def X_WO(scene: Scene, station: Station) -> dict[str, Array]:
    """(4, 4) poses by the names of instances."""
    X_WS = station.document.X_WS.matrix()
    return {n: X_WS @ scene.X_SO(n) for n in (*scene.instances, *scene.background)}
