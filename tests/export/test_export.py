"""What is told of an export, and what is refused."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest

import burg_drake as burg
from burg_drake.core import InvalidInputError, MissingDependencyError, Pose, UnknownNameError
from burg_drake.export import lay_out, model_names, prim_names
from burg_drake.objects import ContactGeometry
from burg_drake.scene import Instance, Scene
from burg_drake.station import Station


def of(scene: Scene, *instances: Instance) -> Scene:
    return Scene(replace(scene.document, instances=instances), scene.library, scene.path)


def test_without_a_station_the_world_is_the_board(scene: Scene) -> None:
    layout = lay_out(scene)
    assert layout.boxes == {}
    for placed in layout.objects:
        assert (scene.X_SO(placed.name) == placed.X_WO).all()


def test_a_name_of_the_station_is_refused(scene: Scene, station: Station) -> None:
    shelf = of(scene, Instance(name="shelf_roof", object="mug"))
    with pytest.raises(InvalidInputError, match=r"'shelf_roof' is taken by station .*panda_shelf"):
        lay_out(shelf, station)


def test_an_unknown_format(scene: Scene, tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match=r"'mjfc' .* 'mjcf'"):
        burg.export_scene(scene, tmp_path / "out", "mjfc")
    assert not (tmp_path / "out").exists()


def test_usd_without_its_package(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pxr", None)  # Python's own way to make a package unknown
    with pytest.raises(MissingDependencyError, match=r"pip install 'burg-drake\[usd\]'"):
        burg.export_scene(scene, tmp_path / "out", "usd")
    assert not (tmp_path / "out").exists()


def test_a_missing_mesh_leaves_nothing_behind(scene: Scene, tmp_path: Path) -> None:
    entry = replace(scene.entry("mug"), mesh="mug/gone.obj")
    objects = {**scene.library.objects, "mug": entry}
    library = replace(scene.library, document=replace(scene.library.document, objects=objects))
    with pytest.raises(UnknownNameError, match=r"gone.obj is missing; build library"):
        burg.export_scene(Scene(scene.document, library, scene.path), tmp_path / "out", "mjcf")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("to", ["mjcf", "usd"])
def test_contact_that_a_format_does_not_have_is_told(scene: Scene, tmp_path: Path, to: str) -> None:
    objects = dict(scene.library.objects)
    objects["mug"] = replace(objects["mug"], contact=ContactGeometry(kind="compliant_pieces"))
    objects["bowl"] = replace(objects["bowl"], pieces=())
    library = replace(scene.library, document=replace(scene.library.document, objects=objects))
    exported = burg.export_scene(Scene(scene.document, library, scene.path), tmp_path / to, to)
    assert [n for n in exported.notes if "called" not in n] == [
        f"'mug' is compliant in Drake; {to} has no hydroelastic modulus",
        f"'box' is a rigid mesh in Drake; in {to} its convex pieces collide",
        f"'bowl' has no convex pieces; its convex hull collides in {to}",
    ]


def test_legal_names_are_unique(scene: Scene) -> None:
    names = ("a.b", "a_b", "a-b", "1", "world", "__x__", "größe")
    layout = lay_out(of(scene, *(Instance(name=n, object="mug", X_SO=Pose()) for n in names)))
    assert model_names(layout) == {n: n for n in names} | {
        "bowl": "bowl",
        "world": "world_1",
        "__x__": "__x___1",
    }
    usd = prim_names(layout)
    assert usd == {
        "a.b": "a_b_2",
        "a_b": "a_b",
        "a-b": "a_b_3",
        "1": "_1",
        "world": "world",
        "__x__": "__x__",
        "größe": "gr__e",
        "bowl": "bowl",
    }
