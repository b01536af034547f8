"""What a check finds: each thing that can go wrong with a library is made to go wrong."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import trimesh
from PIL import Image

from burg_drake.core import save_document
from burg_drake.objects import (
    ContactGeometry,
    Fit,
    ObjectLibrary,
    deviation_warning,
    load_library,
    missing_textures,
)
from burg_drake.pipeline import ObjectSource, build_library, check_library

Fault = Callable[[ObjectLibrary], None]


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A library of a box and a bottle-like thing without any fault, and its meshes."""
    folder = tmp_path_factory.mktemp("sound")
    trimesh.creation.box((0.05, 0.06, 0.07)).export(folder / "box.stl")
    sources = [ObjectSource.from_file(folder / "box.stl", mass=0.1, contact="pieces")]
    assert build_library(sources, folder / "lib").built == ("box",)
    return folder


@pytest.fixture
def library(sound: Path, tmp_path: Path) -> ObjectLibrary:
    shutil.copytree(sound, tmp_path / "copy")
    return load_library(tmp_path / "copy" / "lib")


def test_a_sound_library(library: ObjectLibrary) -> None:
    assert check_library(library) == ()


def test_a_library_without_its_sources_is_sound(library: ObjectLibrary) -> None:
    (library.root.parent / "box.stl").unlink()
    assert check_library(library) == ()


def test_the_built_in_library_is_sound() -> None:
    assert [i.message for i in check_library(load_library("household")) if i.is_error] == []


def lose_a_piece(library: ObjectLibrary) -> None:
    library.path("box/pieces/000.obj").unlink()


def edit_a_piece(library: ObjectLibrary) -> None:
    piece = library.path("box/pieces/000.obj")
    piece.write_text(piece.read_text() + "# by hand\n")


def change_the_source(library: ObjectLibrary) -> None:
    trimesh.creation.box((0.05, 0.06, 0.08)).export(library.root.parent / "box.stl")


def forget_the_record(library: ObjectLibrary) -> None:
    library.path("box/build.json").unlink()


def age_the_record(library: ObjectLibrary) -> None:
    record = library.path("box/build.json")
    record.write_text(json.dumps({**json.loads(record.read_text()), "version": 1}))


def edit_the_document(library: ObjectLibrary) -> None:
    entry = library.entry("box")
    heavier = replace(entry, mass_properties=replace(entry.mass_properties, mass=0.2))
    document = replace(library.document, objects={"box": heavier})
    save_document(document, library.root / "library.yaml")


def forget_the_object(library: ObjectLibrary) -> None:
    save_document(replace(library.document, objects={}), library.root / "library.yaml")


def break_the_model(library: ObjectLibrary) -> None:
    sdf = library.path("box/box.sdf")
    sdf.write_text(sdf.read_text().replace("<mass>0.1", "<mass>-0.1"))


def damage_the_source(library: ObjectLibrary) -> None:
    (library.root.parent / "box.stl").write_bytes(b"")


def _name_another_mesh(library: ObjectLibrary, mesh: str) -> None:
    document = replace(library.document, objects={"box": replace(library.entry("box"), mesh=mesh)})
    save_document(document, library.root / "library.yaml")


def name_a_mesh_elsewhere(library: ObjectLibrary) -> None:
    _name_another_mesh(library, "mesh.obj")


def name_a_folder(library: ObjectLibrary) -> None:
    _name_another_mesh(library, ".")


@pytest.mark.parametrize(
    ("fault", "kind", "message"),
    [
        (lose_a_piece, "missing", "box/pieces/000.obj is missing; build it again"),
        (edit_a_piece, "changed", "box/pieces/000.obj was changed after it was built; build"),
        (
            change_the_source,
            "stale",
            "box.stl has changed since the object was built; build it again",
        ),
        (
            forget_the_record,
            "stale",
            "box was built by another release of burg_drake; build it again",
        ),
        (age_the_record, "stale", "box was built by another release of burg_drake; build it again"),
        (
            edit_the_document,
            "changed",
            "library.yaml was edited: its values differ from what was built",
        ),
        (forget_the_object, "missing", "box is an object that is not in library.yaml; add"),
        (break_the_model, "broken", "box.sdf: "),
        (
            damage_the_source,
            "stale",
            "box.stl has changed since the object was built; build it again",
        ),
        (name_a_mesh_elsewhere, "missing", "lib/mesh.obj is missing; build it again"),
        (name_a_folder, "missing", "lib is missing; build it again"),
    ],
)
def test_faults(library: ObjectLibrary, fault: Fault, kind: str, message: str) -> None:
    fault(library)
    issues = [i for i in check_library(load_library(library.root)) if i.is_error]
    assert kind in [issue.kind for issue in issues]
    assert message in next(issue.message for issue in issues if issue.kind == kind)


def test_pads_that_meet_pieces_are_told(tmp_path: Path) -> None:
    torus = trimesh.creation.torus(0.04, 0.012)
    source = ObjectSource(name="ring", mesh=torus, mass=0.1, pieces=(torus.convex_hull,))
    report = build_library([source], tmp_path / "lib", confirm=False)
    library = report.library
    closed = library.entry("ring").contact
    assert closed.kind == "surface" and closed.mesh == "ring/contact.obj"
    assert not [n for n in report.notes.get("ring", ()) if "pads" in n]
    reason = "its surface is not closed"
    entry = replace(library.entry("ring"), contact=ContactGeometry(reason=reason))
    document = replace(library.document, objects={"ring": entry})
    told = [i for i in check_library(ObjectLibrary(document, library.root)) if "pads" in i.message]
    assert [(i.kind, i.message) for i in told] == [
        (
            "unsure",
            (
                "finger pads touch 1 convex piece, because its surface is not closed; make"
                " the mesh watertight and smooth it, or accept that by 'contact: pieces' in"
                " an objects.yaml"
            ),
        )
    ]


def test_implausible_values(tmp_path: Path) -> None:
    box = trimesh.creation.box((0.05, 0.06, 0.07))
    bowl = trimesh.creation.annulus(r_min=0.03, r_max=0.032, height=0.05)
    sources = [
        ObjectSource(name="leaden", mesh=box, mass=90.0, friction=4.0),
        ObjectSource(name="ring", mesh=bowl, density=1000.0, pieces=(box,)),
    ]
    report = build_library(sources, tmp_path / "lib", confirm=False)
    issues = check_library(report.library)
    assert not [issue for issue in issues if issue.is_error]
    found = {(issue.object, issue.kind): issue.message for issue in issues}
    kinds = [(issue.object, issue.kind) for issue in issues]
    assert ("leaden", "implausible") in kinds and ("ring", "implausible") in kinds
    messages = "\n".join(issue.message for issue in issues)
    assert "friction 4 is unusual: household materials have 0.05 to 1.5" in messages
    assert "the convex pieces do not fit well: " in messages
    assert (
        "mass 0.0194 kg was computed from a density of 1000 kg/m^3, as none was given" in messages
    )
    assert found["leaden", "unsure"] == "its stable poses were not confirmed in simulation"


def test_missing_textures_are_told(tmp_path: Path) -> None:
    """By a build and by a check, until the picture is there."""
    obj = trimesh.creation.box((0.05, 0.06, 0.07)).export(file_type="obj")
    (tmp_path / "box.obj").write_text(f"mtllib box.mtl\nusemtl front\n{obj}")
    (tmp_path / "box.mtl").write_text("newmtl front\nmap_Kd -s 1 1 1 front.png\n")
    source = ObjectSource.from_file(tmp_path / "box.obj", mass=0.1, contact="pieces")
    report = build_library([source], tmp_path / "lib", confirm=False)
    assert not report.failed
    told = "box.mtl names front.png, which is missing, so the object is shown without its texture"
    assert any(note.startswith(told) for note in report.notes["box"])
    assert any(issue.message.startswith(told) for issue in check_library(report.library))
    Image.new("RGB", (4, 4)).save(tmp_path / "front.png")
    report = build_library([source], tmp_path / "lib", confirm=False)
    assert report.built == ("box",) and "box" not in report.notes
    assert not any("front.png" in issue.message for issue in check_library(report.library))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.obj", "mtllib gone.mtl\nv 0 0 0\n"),
        ("a.obj", "mtllib there.mtl gone.mtl # by hand\n"),
        ("a.gltf", '{"images": [{"uri": "gone.png"}, {"uri": 5}, {}]}'),
        ("there.obj", "mtllib\tthere.mtl\n"),
        ("a.ply", "ply\nformat ascii 1.0\ncomment TextureFile gone.png\nend_header\n"),
        ("a.gltf", '{"images": [{"uri": "gone%2Epng"}, {"uri": "data:image/png;base64,"}]}'),
    ],
)
def test_what_names_a_texture(name: str, text: str, tmp_path: Path) -> None:
    (tmp_path / "there.mtl").write_text("map_Kd\tgone.png\n" if name == "there.obj" else "")
    (tmp_path / name).write_text(text)
    found = [s for s in missing_textures(tmp_path / name) if " names 5," not in s]
    named = "there.mtl" if name == "there.obj" else name
    (sentence,) = found
    assert sentence.startswith(f"{named} names gone.")


def test_advice_on_coarse_pieces_is_what_was_not_tried() -> None:
    """At the default threshold and below, finer cuts were tried already."""
    coarse = Fit(volume_ratio=1.6, hausdorff=0.01)
    assert "lower decomposition.threshold" in deviation_warning(coarse, 0.1, 0.2)
    for threshold in (0.05, 0.01, None):
        assert "pieces of your own" in deviation_warning(coarse, 0.1, threshold)
