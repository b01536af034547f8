"""Whole builds: what is built, what is kept, and what fails alone."""

from __future__ import annotations

import json
import os
import shutil
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from burg_drake.core import InvalidInputError
from burg_drake.objects import ObjectLibrary, StablePose, SymmetrySearch, load_library, stable_poses
from burg_drake.pipeline import (
    BuildReport,
    ObjectSource,
    build_library,
    build_record,
    decomposition,
    object_build,
)
from burg_drake.simulation import Confirmation


def _box(size: tuple[float, float, float] = (0.1, 0.06, 0.03)) -> trimesh.Trimesh:
    return trimesh.creation.box(size)


@pytest.fixture
def meshes(tmp_path: Path) -> Path:
    return _write_meshes(tmp_path / "meshes")


def _write_meshes(folder: Path) -> Path:
    folder.mkdir()
    _box().export(folder / "Box.stl")
    trimesh.creation.cylinder(0.03, 0.1, sections=32).export(folder / "can.obj")
    return folder


def _sources(meshes: Path, mass: float = 0.2) -> list[ObjectSource]:
    return [
        ObjectSource.from_file(meshes / "Box.stl", mass=mass),
        ObjectSource.from_file(meshes / "can.obj"),
    ]


@pytest.fixture(scope="module")
def first_build(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with `meshes`, and the library `lib` that was built of them."""
    folder = tmp_path_factory.mktemp("first")
    _write_meshes(folder / "meshes")
    build(_sources(folder / "meshes"), folder / "lib")
    return folder


@pytest.fixture
def built(first_build: Path, meshes: Path, tmp_path: Path) -> None:
    """`lib` is there already, built of `meshes`."""
    shutil.copytree(first_build / "lib", tmp_path / "lib")


def _times(root: Path) -> dict[str, int]:
    return {str(p.relative_to(root)): p.stat().st_mtime_ns for p in root.rglob("*") if p.is_file()}


def _contents(root: Path) -> dict[str, bytes]:
    return {str(p.relative_to(root)): p.read_bytes() for p in root.rglob("*") if p.is_file()}


def build(sources: object, out: Path, **options: object) -> BuildReport:
    """Builds without the simulation of stable poses, which has tests of its own."""
    return build_library(sources, out, **{"confirm": False, **options})  # type: ignore[arg-type]


def test_entries_say_what_was_built(meshes: Path, tmp_path: Path) -> None:
    report = build(_sources(meshes), tmp_path / "lib", name="things")
    assert report.built == ("box", "can")
    assert (report.cached, report.failed) == ((), {})
    box = report.library.entry("box")
    assert box.mass == 0.2
    assert box.friction == 0.24
    assert box.source.file == "Box.stl"
    np.testing.assert_allclose(np.subtract(box.upper, box.lower), [0.1, 0.06, 0.03], atol=1e-7)
    assert len(box.stable_poses) == 3
    assert len(box.pieces) == 1
    for relative in (box.mesh, box.sdf, *box.pieces):
        assert report.library.path(relative).is_file()
    assert load_library(tmp_path / "lib").document == report.library.document
    assert report.library.name == "things"


def test_a_density_that_was_assumed_is_reported(meshes: Path, tmp_path: Path) -> None:
    report = build(_sources(meshes), tmp_path / "lib")
    mass = 300.0 * 16 * np.sin(2 * np.pi / 32) * 0.03**2 * 0.1  # a prism with 32 sides
    assert report.notes["can"] == (
        f"no mass or density given: computed {mass:.4g} kg from volume and 300 kg/m^3",
    )
    assert "box" not in report.notes


@pytest.mark.usefixtures("built")
def test_what_has_not_changed_is_not_touched(meshes: Path, tmp_path: Path) -> None:
    build(_sources(meshes), tmp_path / "lib")
    before = _times(tmp_path / "lib")
    report = build(_sources(meshes), tmp_path / "lib")
    assert report.cached == ("box", "can")
    assert _times(tmp_path / "lib") == before


@pytest.mark.usefixtures("built")
def test_a_new_mass_rewrites_the_sdf_and_nothing_else(
    meshes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = build(_sources(meshes), tmp_path / "lib").library.entry("box")
    before = _times(tmp_path / "lib")
    monkeypatch.setattr(
        object_build, "load_mesh", None
    )  # neither the mesh nor the pieces are needed
    report = build(_sources(meshes, mass=0.4), tmp_path / "lib")
    assert (report.built, report.cached) == (("box",), ("can",))
    changed = {k for k, t in _times(tmp_path / "lib").items() if before.get(k) != t}
    assert changed == {"library.yaml", "box/box.sdf", "box/build.json"}
    entry = report.library.entry("box")
    assert entry.build != first.build
    np.testing.assert_allclose(
        entry.mass_properties.inertia, 2.0 * np.array(first.mass_properties.inertia)
    )
    assert "<mass>0.4</mass>" in report.library.path(entry.sdf).read_text()


@pytest.mark.usefixtures("built")
def test_a_new_colour_keeps_the_pieces(
    meshes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = _sources(meshes)[0]
    build([source], tmp_path / "lib")
    pieces = (tmp_path / "lib/box/pieces/000.obj").read_bytes()
    monkeypatch.setattr(object_build, "cut_into_pieces", None)
    report = build([replace(source, rgba=(1.0, 0.0, 0.0, 1.0))], tmp_path / "lib")
    assert report.built == ("box",)
    assert "Kd 1 0 0" in (tmp_path / "lib/box/mesh.mtl").read_text()
    assert (tmp_path / "lib/box/pieces/000.obj").read_bytes() == pieces


@pytest.mark.usefixtures("built")
def test_a_changed_mesh_is_built_again(meshes: Path, tmp_path: Path) -> None:
    build(_sources(meshes), tmp_path / "lib")
    _box((0.12, 0.06, 0.03)).export(meshes / "Box.stl")
    report = build(_sources(meshes), tmp_path / "lib")
    assert report.built == ("box",)
    assert report.library.entry("box").upper[0] == pytest.approx(0.06)


@pytest.mark.usefixtures("built")
def test_lost_files_are_built_again(meshes: Path, tmp_path: Path) -> None:
    report = build(_sources(meshes), tmp_path / "lib")
    report.library.path(report.library.entry("box").pieces[0]).unlink()
    assert build(_sources(meshes), tmp_path / "lib").built == ("box",)
    report.library.path(report.library.entry("box").mesh).unlink()
    assert build(_sources(meshes), tmp_path / "lib").built == ("box",)


@pytest.mark.usefixtures("built")
def test_a_new_description_is_taken_over(meshes: Path, tmp_path: Path) -> None:
    source = _sources(meshes)[0]
    before = build([source], tmp_path / "lib").library.entry("box")
    report = build([replace(source, description="a box")], tmp_path / "lib")
    assert report.library.entry("box").description == "a box"
    assert report.library.entry("box").build == before.build  # results stay valid


def test_objects_of_earlier_builds_stay(meshes: Path, tmp_path: Path) -> None:
    first, second = _sources(meshes)
    build([second], tmp_path / "lib", name="things")
    report = build([first], tmp_path / "lib")
    assert list(report.library.objects) == ["box", "can"]
    assert report.library.name == "things"


def test_the_same_input_gives_the_same_bytes(meshes: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        build(_sources(meshes), tmp_path / name, name="things", workers=1 + (name == "b"))
    assert _contents(tmp_path / "a") == _contents(tmp_path / "b")


def test_one_broken_mesh_fails_alone(meshes: Path, tmp_path: Path) -> None:
    (meshes / "broken.obj").write_text("v 0 0 0\n")
    seen: list[tuple[str, str, int, int]] = []
    sources = [
        *_sources(meshes),
        ObjectSource.from_file(meshes / "broken.obj"),
        ObjectSource.from_file(meshes / "missing.obj"),
        ObjectSource(name="nothing", mesh=_box(), mass=0.0),
    ]
    report = build(sources, tmp_path / "lib", progress=lambda *event: seen.append(event))
    assert report.built == ("box", "can")
    assert report.failed == {
        "broken": f"{meshes / 'broken.obj'}: the mesh file has no triangles",
        "missing": f"{meshes / 'missing.obj'}: the mesh file does not exist",
        "nothing": "nothing: mass is 0 kg; it must be above 0 (leave it out to use a density)",
    }
    assert sorted(event[0] for event in seen) == ["box", "broken", "can", "missing", "nothing"]
    assert [event[2:] for event in seen] == [(k, 5) for k in range(1, 6)]
    assert not (tmp_path / "lib" / "broken").exists()


@pytest.mark.usefixtures("built")
def test_a_failure_keeps_the_earlier_object(meshes: Path, tmp_path: Path) -> None:
    build(_sources(meshes), tmp_path / "lib")
    (meshes / "Box.stl").write_bytes(b"")
    report = build(_sources(meshes), tmp_path / "lib")
    assert list(report.failed) == ["box"]
    assert report.library.path(report.library.entry("box").sdf).is_file()


def test_programming_errors_in_one_object_do_not_stop_the_others(
    meshes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = decomposition.convex_pieces

    def fails_for_cans(surface, *args):  # type: ignore[no-untyped-def]
        if len(surface.vertices) > 8:
            raise TypeError("incompatible arguments, supported are:\n  1. (int) -> str\n")
        return original(surface, *args)

    monkeypatch.setattr(decomposition, "convex_pieces", fails_for_cans)
    report = build(_sources(meshes), tmp_path / "lib")
    assert report.built == ("box",)
    expected = "TypeError: incompatible arguments, supported are: 1. (int) -> str"
    assert report.failed == {"can": expected}


def test_a_file_that_breaks_its_reader_fails_alone(
    meshes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = build_record.mesh_hash

    def fails_for_cans(mesh):  # type: ignore[no-untyped-def]
        if "box" not in str(mesh).lower():
            raise RecursionError("too deep")
        return original(mesh)

    monkeypatch.setattr(build_record, "mesh_hash", fails_for_cans)
    report = build(_sources(meshes), tmp_path / "lib")
    assert report.built == ("box",)
    assert report.failed == {"can": "RecursionError: too deep"}


def test_a_kill_loses_nothing_that_was_finished(
    meshes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(name: str, *_: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build(_sources(meshes), tmp_path / "lib", progress=killed)
    assert len(load_library(tmp_path / "lib").objects) == 1
    report = build(_sources(meshes), tmp_path / "lib")
    assert len(report.cached) == 1
    assert len(report.built) == 1


@pytest.mark.usefixtures("built")
def test_what_a_killed_build_left_lying_is_removed(meshes: Path, tmp_path: Path) -> None:
    dead = tmp_path / "lib" / ".building-999999999-abc"
    (dead / "box").mkdir(parents=True)
    build(_sources(meshes), tmp_path / "lib")
    assert sorted(p.name for p in (tmp_path / "lib").iterdir()) == [
        "box",
        "can",
        "library.yaml",
        "package.xml",
    ]


def test_names_that_collide(meshes: Path, tmp_path: Path) -> None:
    _box().export(meshes / "box.ply")
    with pytest.raises(
        InvalidInputError, match=r"2 meshes have the same object name 'box': .*Box.stl, "
    ):
        build([meshes / "Box.stl", meshes / "box.ply"], tmp_path / "lib")


def test_places_that_cannot_be_written_to(meshes: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInputError, match=r"cannot write to folder .*file"):
        build(_sources(meshes), tmp_path / "file")


def test_given_pieces_become_the_collision_geometry(tmp_path: Path) -> None:
    halves = tuple(_box((0.05, 0.06, 0.03)).apply_translation([x, 0, 0]) for x in (-0.025, 0.025))
    source = ObjectSource(name="box", mesh=_box(), pieces=halves, mass=0.1, contact="pieces")
    report = build([source], tmp_path / "lib")
    entry = report.library.entry("box")
    assert len(entry.pieces) == 2
    assert report.library.path(entry.sdf).read_text().count("<drake:declare_convex/>") == 2


@pytest.mark.thorough
def test_objects_of_before_get_a_surface_and_are_told(tmp_path: Path) -> None:
    torus = trimesh.creation.torus(0.04, 0.012)
    source = ObjectSource(name="ring", mesh=torus, mass=0.1, pieces=(torus.convex_hull,))
    first = build_library([source], tmp_path, confirm=False)
    assert first.library.entry("ring").contact.kind == "surface"
    record = tmp_path / "ring" / "build.json"
    data = json.loads(record.read_text())
    del data["geometry"]["contact"]
    record.write_text(json.dumps({**data, "version": 2}))
    again = build_library([source], tmp_path, confirm=False)
    assert again.built == ("ring",)
    told = "built again: finger pads now touch the object's own surface"
    assert told in again.notes["ring"] and told not in first.notes["ring"]


def test_open_meshes_become_walls(tmp_path: Path) -> None:
    lidless = _box()
    lidless.update_faces(lidless.triangles_center[:, 2] < 0.0149)
    source = ObjectSource(
        name="box", mesh=lidless, pieces=(_box(),), mass=0.1, wall_thickness=0.001
    )
    report = build([source], tmp_path / "lib")
    properties = report.library.entry("box").mass_properties
    area = 0.1 * 0.06 + 2.0 * (0.1 + 0.06) * 0.03
    assert properties.volume == pytest.approx(0.001 * area, rel=0.05)
    assert properties.wall_thickness == 0.001
    assert properties.center_of_mass[2] < -0.004  # lower than that of the full box


def test_closed_meshes_become_hollow(tmp_path: Path) -> None:
    source = ObjectSource(name="box", mesh=_box(), mass=0.1, wall_thickness=0.002)
    properties = build([source], tmp_path / "lib").library.entry("box").mass_properties
    outer, inner = (0.1, 0.06, 0.03), (0.096, 0.056, 0.026)
    assert properties.volume == pytest.approx(np.prod(outer) - np.prod(inner), rel=1e-6)
    assert properties.mass == 0.1


def test_ten_unchanged_objects_take_less_than_a_fifth_of_a_second(tmp_path: Path) -> None:
    mesh = _box()
    sources = [
        ObjectSource(name=f"box_{i}", mesh=mesh, mass=0.1, contact="pieces") for i in range(10)
    ]
    build(sources, tmp_path / "lib")
    start = time.process_time()
    assert len(build(sources, tmp_path / "lib").cached) == 10
    assert time.process_time() - start < 0.2


@pytest.mark.usefixtures("built")
def test_permissions_are_those_of_other_files(meshes: Path, tmp_path: Path) -> None:
    build(_sources(meshes), tmp_path / "lib")
    umask = os.umask(0)
    os.umask(umask)
    assert (tmp_path / "lib/box").stat().st_mode & 0o777 == 0o777 & ~umask


@pytest.mark.thorough
def test_another_coacd_version_cuts_again_what_it_cut(
    meshes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = ObjectSource(name="given", mesh=_box(), pieces=(_box(),), mass=0.1)
    sources = [*_sources(meshes), given]
    build(sources, tmp_path / "lib")
    true = build_record.package_version
    monkeypatch.setattr(
        build_record,
        "package_version",
        lambda name, missing: "another" if name == "coacd" else true(name, missing),
    )
    report = build(sources, tmp_path / "lib")
    assert (report.built, report.cached) == (("box", "can"), ("given",))


def test_stable_poses_are_confirmed_in_simulation(tmp_path: Path) -> None:
    source = ObjectSource(name="box", mesh=_box(), mass=0.1)
    poses = build_library([source], tmp_path / "lib").library.entry("box").stable_poses
    assert len(poses) == 3
    assert all(pose.residual is not None and pose.residual < np.deg2rad(1.0) for pose in poses)
    assert not any(pose.rolls for pose in poses)
    unconfirmed = build([source], tmp_path / "lib")
    assert unconfirmed.built == ("box",)
    assert all(p.residual is None for p in unconfirmed.library.entry("box").stable_poses)


def test_a_new_mass_needs_no_new_simulation(
    meshes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = _sources(meshes)[0]
    first = build_library([source], tmp_path / "lib").library.entry("box")
    monkeypatch.setattr(object_build, "_confirm_poses", None)
    changed = replace(source, mass=2.0, friction=0.7, inertia=(2e-3, 2e-3, 3e-3, 0.0, 0.0, 0.0))
    second = build_library([changed], tmp_path / "lib").library.entry("box")
    assert second.stable_poses == first.stable_poses
    assert second.mass_properties.overridden == ("inertia",)
    assert second.friction == 0.7


def test_the_centre_of_mass_decides_how_it_rests(tmp_path: Path) -> None:
    tall = _box((0.04, 0.04, 0.2))
    source = ObjectSource(name="post", mesh=tall, mass=0.1, center_of_mass=(0.0, 0.0, -0.09))
    report = build([source], tmp_path / "lib")
    entry = report.library.entry("post")
    assert entry.mass_properties.center_of_mass == (0.0, 0.0, -0.09)
    upright = [p for p in entry.stable_poses if p.X_SO.matrix()[2, 2] > 0.99]
    solid_angle = 4.0 * np.arctan(0.02 * 0.02 / (0.01 * np.sqrt(2 * 0.02**2 + 0.01**2)))
    assert [p.probability for p in upright] == pytest.approx([solid_angle / (4 * np.pi)], abs=2e-3)
    assert not [p for p in entry.stable_poses if p.X_SO.matrix()[2, 2] < -0.99]


@pytest.mark.usefixtures("built")
def test_where_a_mesh_came_from_is_told_from_the_library(meshes: Path, tmp_path: Path) -> None:
    entry = build(_sources(meshes), tmp_path / "lib").library.entry("can")
    assert (entry.source.file, entry.source.path) == ("can.obj", "../meshes/can.obj")


def test_a_library_is_a_package(meshes: Path, tmp_path: Path) -> None:
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    build(_sources(meshes), tmp_path / "lib", name="My.Things")
    moved = tmp_path / "moved"
    (tmp_path / "lib").rename(moved)
    plant = MultibodyPlant(0.001)
    parser = Parser(plant)
    parser.package_map().AddPackageXml(str(moved / "package.xml"))
    (model,) = parser.AddModelsFromUrl("package://my_things/can/can.sdf")
    assert plant.HasBodyNamed("body", model)


@pytest.mark.usefixtures("built")
@pytest.mark.parametrize("mass", [0.2, 0.4])
def test_files_that_were_changed_are_built_again(meshes: Path, tmp_path: Path, mass: float) -> None:
    build(_sources(meshes), tmp_path / "lib")
    piece = tmp_path / "lib/box/pieces/000.obj"
    before = piece.read_bytes()
    piece.write_bytes(before.replace(b"0.05", b"0.09"))
    (tmp_path / "lib/box/mesh.mtl").unlink()
    report = build(_sources(meshes, mass=mass), tmp_path / "lib")
    assert (report.built, report.cached) == (("box",), ("can",))
    assert piece.read_bytes() == before
    assert (tmp_path / "lib/box/mesh.mtl").is_file()


@pytest.mark.usefixtures("built")
def test_a_document_that_was_edited_is_written_again(meshes: Path, tmp_path: Path) -> None:
    build(_sources(meshes), tmp_path / "lib")
    document = tmp_path / "lib/library.yaml"
    before = document.read_text()
    document.write_text(before.replace("mass: 0.2", "mass: 7.5"))
    assert build(_sources(meshes), tmp_path / "lib").built == ("box",)
    assert document.read_text() == before


def test_symmetries_are_searched_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the stable poses are merged by is what they are confirmed by."""
    searches = []

    def confirmed(library: ObjectLibrary, name: str, search: SymmetrySearch) -> Confirmation:
        searches.append(search)
        return Confirmation(library.entry(name).stable_poses, ())

    def merged(*args: Any) -> tuple[StablePose, ...]:
        searches.append(args[3])
        return stable_poses(*args)

    monkeypatch.setattr("burg_drake.simulation.confirm_poses", confirmed)
    monkeypatch.setattr(object_build, "stable_poses", merged)
    build([ObjectSource(name="box", mesh=_box())], tmp_path / "lib", confirm=True)
    first, second = searches
    assert first is second
