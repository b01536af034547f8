"""`burg-drake library`: what is built, and one line for each thing that is wrong."""

from __future__ import annotations

import contextlib
import json
import shutil
from pathlib import Path
from typing import Any

import pytest
import trimesh

from burg_drake.apps import main
from burg_drake.objects import load_library
from burg_drake.pipeline import ObjectSource, object_build
from burg_drake.system_libraries import SystemLibrary

Capture = pytest.CaptureFixture[str]
QUICK = "--no-confirm"


def build(*arguments: object) -> int:
    return main(["library", "build", *map(str, arguments), "--workers", "1", "--quiet"])


def test_build_and_list(mesh: Path, tmp_path: Path, capsys: Capture) -> None:
    library = tmp_path / "library"
    assert build(mesh, "-o", library, "--mass", "block=0.2", "--friction", "0.5") == 0
    entry = load_library(library).entry("block")
    assert (entry.mass, entry.friction) == (0.2, 0.5)
    assert "1 built, 0 up to date, 0 failed" in capsys.readouterr().out
    assert build(mesh, "-o", library, "--mass", "block=0.2", "--friction", "0.5") == 0
    assert "0 built, 1 up to date, 0 failed" in capsys.readouterr().out
    assert main(["library", "list", str(library)]) == 0
    listing = capsys.readouterr().out
    assert "50 x 40 x 60" in listing and "200.0" in listing and "1 object in" in listing


def test_build_and_check_say_what_pads_touch(mesh: Path, tmp_path: Path, capsys: Capture) -> None:
    trimesh.creation.torus(0.04, 0.012).export(tmp_path / "ring.stl")
    library = tmp_path / "library"
    masses = ("--mass", "block=0.2", "--mass", "ring=0.1")
    assert build(mesh, tmp_path / "ring.stl", QUICK, "-o", library, *masses) == 0
    faces = len(load_library(library).mesh("ring/contact.obj").faces)
    expected = [
        "block: gripper pads touch a box, at most ",
        f"ring: gripper pads touch a surface with {faces} faces, at most 0.",
    ]

    def told() -> list[str]:
        lines = [line for line in capsys.readouterr().out.splitlines() if "pads touch" in line]
        return [line[: len(text)] for line, text in zip(lines, expected, strict=False)]

    assert told() == expected
    assert main(["library", "check", str(library)]) == 0
    assert told() == expected
    (library / "ring" / "contact.obj").unlink()
    assert main(["library", "check", str(library)]) == 1
    assert told() == expected[:1]


def test_a_library_of_an_earlier_release_is_told_and_built_again(
    tmp_path: Path, capsys: Capture
) -> None:
    """In releases of before, pads met the pieces of an object."""
    torus, library = tmp_path / "ring.stl", tmp_path / "library"
    trimesh.creation.torus(0.04, 0.012).export(torus)
    assert build(torus, QUICK, "-o", library, "--mass", "ring=0.1") == 0
    record = library / "ring" / "build.json"
    data = json.loads(record.read_text())
    del data["geometry"]["contact"]
    record.write_text(json.dumps({**data, "version": data["version"] - 1}))
    capsys.readouterr()
    assert main(["library", "check", str(library)]) == 1
    told = capsys.readouterr()
    assert "ring was built by another release of burg_drake; build it again" in told.out + told.err
    assert build(torus, QUICK, "-o", library, "--mass", "ring=0.1") == 0
    told = capsys.readouterr()
    assert "1 built, 0 up to date, 0 failed" in told.out
    assert "built again: finger pads now touch the object's own surface" in told.out + told.err
    assert main(["library", "check", str(library)]) == 0


def test_friction_of_one_and_of_all(mesh: Path, tmp_path: Path) -> None:
    shutil.copy(mesh, tmp_path / "Other-Block.ply")
    masses = tmp_path / "masses.yaml"
    masses.write_text("block: 0.1\nOther-Block: 0.3\n")
    arguments = ("--masses", masses, "--friction", "0.3", "--friction", "block=0.6")
    assert build(tmp_path, QUICK, "-o", tmp_path / "library", *arguments) == 0
    objects = load_library(tmp_path / "library").objects
    assert {n: (o.mass, o.friction) for n, o in objects.items()} == {
        "block": (0.1, 0.6),
        "other_block": (0.3, 0.3),
    }


def test_scale_and_density(tmp_path: Path) -> None:
    trimesh.creation.box((50, 40, 60)).export(tmp_path / "block.stl")
    arguments = ("--scale", "0.001", "--density", "1000")
    assert build(tmp_path / "block.stl", QUICK, "-o", tmp_path / "library", *arguments) == 0
    assert load_library(tmp_path / "library").entry("block").mass == pytest.approx(0.12, rel=1e-6)


def test_one_broken_mesh_is_one_failure(mesh: Path, tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "broken.obj").write_text("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert build(mesh, tmp_path / "broken.obj", QUICK, "-o", tmp_path / "library") == 1
    captured = capsys.readouterr()
    (line,) = captured.err.splitlines()
    assert line.startswith("burg-drake: error: ")
    assert "broken.obj: 1 of 3 vertices are NaN or infinite" in line
    assert captured.out.splitlines()[-1].endswith(": 1 built, 0 up to date, 1 failed (broken)")
    assert list(load_library(tmp_path / "library").objects) == ["block"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "the mesh file does not exist"),
        ("", "the mesh file is empty"),
        ("hello\n", "no triangles"),
    ],
)
def test_nothing_could_be_built(
    content: str | None, message: str, tmp_path: Path, capsys: Capture
) -> None:
    path = tmp_path / "mesh.obj"
    if content is not None:
        path.write_text(content)
    assert build(path, "-o", tmp_path / "library") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"burg-drake: error: {path}: ") and message in line
    assert not (tmp_path / "library").exists()


@pytest.mark.parametrize("others", [0, 1])
def test_an_unexpected_error_names_the_object_and_is_told_in_full(
    others: int, mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    original = object_build.build_geometry

    def fails_for_me(source: ObjectSource, *arguments: Any) -> Any:
        if source.name == "me":
            raise TypeError("name of me is wrong, supported are:\n  1. (int) -> str")
        return original(source, *arguments)

    monkeypatch.setattr(object_build, "build_geometry", fails_for_me)
    shutil.copy(mesh, tmp_path / "me.ply")
    meshes = (tmp_path / "me.ply", mesh)[: 1 + others]
    assert build(*meshes, QUICK, "-o", tmp_path / "library") == 2 - others
    captured = capsys.readouterr()
    text = "me: TypeError: name of me is wrong, supported are: 1. (int) -> str"
    assert captured.err.splitlines() == [f"burg-drake: error: {text}"]
    summary = f"{tmp_path / 'library'}: {others} built, 0 up to date, 1 failed (me)"
    assert captured.out.splitlines()[-1] == summary


def test_millimetres_are_pointed_out(tmp_path: Path, capsys: Capture) -> None:
    trimesh.creation.box((50, 40, 60)).export(tmp_path / "block.stl")
    assert build(tmp_path / "block.stl", "-o", tmp_path / "library") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "try unit mm (scale=0.001 makes it 60 mm)" in line
    assert not (tmp_path / "library").exists()


def test_a_wrong_unit_is_told_before_the_others_are_built(
    mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    """And the unit of one mesh can be given, by which it gets its size."""
    original, told = object_build.build_geometry, []

    def told_by_now(*arguments: Any) -> Any:
        told.append(capsys.readouterr().err)
        return original(*arguments)

    monkeypatch.setattr(object_build, "build_geometry", told_by_now)
    trimesh.creation.box((50, 40, 60)).export(tmp_path / "wrong.stl")
    meshes = (mesh, tmp_path / "wrong.stl")
    assert build(*meshes, QUICK, "-o", tmp_path / "library") == 1
    assert len(told) == 1 and "wrong.stl: taken as metres, the mesh is 60 m long" in told[0]
    assert told[0].endswith("; for this mesh alone --unit wrong=mm\n")
    capsys.readouterr()
    assert build(*meshes, QUICK, "-o", tmp_path / "library", "--unit", "wrong=mm") == 0
    library = load_library(tmp_path / "library")
    assert library.entry("wrong").upper == pytest.approx((0.025, 0.02, 0.03))
    assert library.entry("block").source.scale == 1.0


@pytest.mark.parametrize(
    ("unit", "message"),
    [
        ("block=foot", "'block=foot' is not [NAME=]UNIT with one of the units mm, cm, m, in"),
        ("blok=mm", "--unit blok: no such mesh; did you mean 'block'?"),
    ],
)
def test_units_that_are_none(
    unit: str, message: str, mesh: Path, tmp_path: Path, capsys: Capture
) -> None:
    with contextlib.suppress(SystemExit):
        assert build(mesh, "-o", tmp_path / "library", "--unit", unit) == 2
    assert message in capsys.readouterr().err


def test_folders_of_the_users_are_not_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    (tmp_path / "cube").mkdir()
    trimesh.creation.box((0.05, 0.04, 0.06)).export(tmp_path / "cube" / "cube.obj")
    before = (tmp_path / "cube" / "cube.obj").read_bytes()
    monkeypatch.chdir(tmp_path)
    assert build("cube/cube.obj", "-o", ".") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"burg-drake: error: {tmp_path / 'cube'} exists and is not an object of")
    assert (tmp_path / "cube" / "cube.obj").read_bytes() == before
    assert [p.name for p in tmp_path.rglob("*")] == ["cube", "cube.obj"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--mass", "block=0"], "argument --mass: block: 0 is not above 0"),
        (["--mass", "block=-2"], "argument --mass: block: -2 is not above 0"),
        (["--mass", "block=nan"], "argument --mass: block: 'nan' is not a finite number"),
        (["--mass", "block"], "argument --mass: 'block' is not NAME=VALUE, such as mug=0.118"),
        (["--mass", "blok=1"], "--mass blok: no such mesh; did you mean 'block'? Known: block"),
        (["--friction", "-0.1"], "-0.1 is not a friction coefficient from 0"),
        (["--friction", "blok=1"], "--friction blok: no such mesh; did you mean 'block'?"),
        (["--scale", "0"], "argument --scale: 0 is not above 0"),
        (["--density", "inf"], "argument --density: 'inf' is not a finite number"),
    ],
)
def test_bad_numbers(
    arguments: list[str], message: str, mesh: Path, tmp_path: Path, capsys: Capture
) -> None:
    try:
        code = build(mesh, "-o", tmp_path / "library", *arguments)
    except SystemExit as ended:
        code = ended.code  # type: ignore[assignment]
    assert code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("burg-drake: error: ") and message in line
    assert not (tmp_path / "library").exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("block: 0\n", "masses.yaml:1: block: mass is 0; give kilograms above 0"),
        ("block: heavy\n", "masses.yaml:1: block: mass is heavy; give kilograms above 0"),
        ("# none\n\nblock:\n", "masses.yaml:3: block: mass is missing; give kilograms above 0"),
        ("block: [1]\n", "masses.yaml:1: block: mass is a structure; give kilograms above 0"),
        ("block: .nan\n", "masses.yaml:1: block: mass is .nan; give kilograms above 0"),
        ("block: 1\nBlock: 2\n", "masses.yaml:2: Block: its mass is given twice"),
        ("block: 1\nblok: 2\n", "masses.yaml:2: blok: no such mesh; did you mean 'block'?"),
        ("[block]: 1\n", "masses.yaml:1: expected a line 'NAME: KG', such as 'mug: 0.118'"),
        ("", "masses.yaml: expected lines 'NAME: KG', such as 'mug: 0.118'"),
        ("- block\n", "masses.yaml:1: expected lines 'NAME: KG', such as 'mug: 0.118'"),
        ("block: [\n", "masses.yaml:2: not valid YAML"),
        (None, "masses.yaml: No such file or directory"),
    ],
)
def test_bad_masses(
    text: str | None, message: str, mesh: Path, tmp_path: Path, capsys: Capture
) -> None:
    masses = tmp_path / "masses.yaml"
    if text is not None:
        masses.write_text(text)
    assert build(mesh, "-o", tmp_path / "library", "--masses", masses) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line


def test_mass_0_in_a_library(mesh: Path, tmp_path: Path, capsys: Capture) -> None:
    library = tmp_path / "library"
    assert build(mesh, QUICK, "-o", library, "--mass", "block=0.25") == 0
    text = (library / "library.yaml").read_text()
    (library / "library.yaml").write_text(text.replace("mass: 0.25", "mass: 0"))
    capsys.readouterr()
    assert main(["library", "list", str(library)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "objects.block.mass_properties: mass is 0 kg; a free object needs a mass above 0" in line


def test_unwritable_output(mesh: Path, capsys: Capture) -> None:
    assert build(mesh, "-o", mesh) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"burg-drake: error: cannot write to folder {mesh}: ")


def test_folder_without_meshes(tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "empty").mkdir()
    assert build(tmp_path / "empty", "-o", tmp_path / "library") == 2
    assert "holds no mesh (.obj, .ply, .stl, .off, .glb, .gltf)" in capsys.readouterr().err


def test_a_missing_system_library_is_named_before_anything_is_built(
    capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "burg_drake.apps.commands.library.missing_import_libraries", lambda: [SystemLibrary.glib]
    )
    trimesh.creation.box((0.05, 0.05, 0.05)).export(tmp_path / "box.stl")
    assert build(str(tmp_path / "box.stl"), "-o", str(tmp_path / "library")) == 2
    assert "cannot be imported without libglib-2.0.so.0" in capsys.readouterr().err


def test_the_help_describes_masses_files(capsys: Capture) -> None:
    with pytest.raises(SystemExit):
        build("--help")
    text = capsys.readouterr().out
    assert "decomposition.threshold" in text and "2,000,000 triangles" in text
    assert "YAML file of 'NAME: KG' lines" in text


def test_masses_of_the_command_line_go_first(mesh: Path, tmp_path: Path) -> None:
    (tmp_path / "masses.yaml").write_text("block: 1\n")
    arguments = ("--masses", tmp_path / "masses.yaml", "--mass", "block=0.2")
    assert build(mesh, QUICK, "-o", tmp_path / "library", *arguments) == 0
    assert load_library(tmp_path / "library").entry("block").mass == 0.2
