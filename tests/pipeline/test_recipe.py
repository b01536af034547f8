"""Recipes of libraries, and what can be wrong with them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import trimesh

from burg_drake.core import DocumentError, save_document
from burg_drake.objects import Decomposition
from burg_drake.pipeline import (
    Cutting,
    Defaults,
    ObjectSource,
    RecipeDocument,
    RecipeObject,
    build_library,
    check_source,
    load_recipe,
)

FULL = """\
version: 1
name: kitchen
defaults:
  unit: mm
  density: 800
  friction: 0.4
  decomposition: {threshold: 0.1, seed: 3}
objects:
  mug:
    mesh: scans/mug.stl
    mass: 0.118
    description: white, with a handle
    contact: primitive
  tray:
    mesh: ../cad/tray.obj
    scale: 0.0254
    wall_thickness: 0.002
    openings: close
    center_of_mass: [0, 0, 0.01]
    inertia: [1.0e-4, 2.0e-4, 2.5e-4, 0, 1.0e-5, 0]
    rgba: [0.5, 0, 0, 1]
    density: 900
    friction: 0.2
    decomposition: {threshold: 0.02}
  block: {mesh: block.obj}
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "objects.yaml"
    path.write_text(text)
    return path


def sources(folder: Path, text: str) -> dict[str, ObjectSource]:
    return {s.name: s for s in load_recipe(written(folder, text)).sources()}


def test_everything_that_a_recipe_says(tmp_path: Path) -> None:
    recipe = load_recipe(written(tmp_path, FULL))
    assert recipe.name == "kitchen"
    mug, tray, block = recipe.sources()
    assert [s.name for s in (mug, tray, block)] == ["mug", "tray", "block"]

    assert mug.mesh == tmp_path / "scans/mug.stl"
    assert (mug.mass, mug.density, mug.friction, mug.scale) == (0.118, None, 0.4, 1e-3)
    assert (mug.contact, mug.description) == ("primitive", "white, with a handle")
    assert mug.decomposition == Decomposition(threshold=0.1, seed=3)
    assert (mug.openings, mug.wall_thickness, mug.rgba) == ("wall", None, None)
    assert (mug.center_of_mass, mug.inertia, mug.pieces) == (None, None, None)

    assert tray.mesh == tmp_path / "../cad/tray.obj"
    assert (tray.mass, tray.density, tray.friction, tray.scale) == (None, 900.0, 0.2, 0.0254)
    assert (tray.wall_thickness, tray.openings) == (0.002, "close")
    assert tray.center_of_mass == (0.0, 0.0, 0.01)
    assert tray.inertia == (1e-4, 2e-4, 2.5e-4, 0.0, 1e-5, 0.0)
    assert tray.rgba == (0.5, 0.0, 0.0, 1.0)
    assert tray.decomposition == Decomposition(threshold=0.02, seed=3)

    assert (block.mass, block.density, block.friction, block.scale) == (None, 800.0, 0.4, 1e-3)
    for source in (mug, tray, block):
        check_source(source)


def test_without_more_an_object_is_what_its_mesh_file_says(tmp_path: Path) -> None:
    (path,) = load_recipe(written(tmp_path, "version: 1\nobjects: {a: {mesh: a.obj}}")).sources()
    plain = ObjectSource(name="a", mesh=tmp_path / "a.obj")
    assert vars(path) == vars(plain)


@pytest.mark.parametrize(
    ("unit", "metres"), [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("in", 0.0254)]
)
def test_units(tmp_path: Path, unit: str, metres: float) -> None:
    text = f"version: 1\nobjects: {{a: {{mesh: a.obj, unit: {unit}}}}}"
    assert sources(tmp_path, text)["a"].scale == metres


@pytest.mark.parametrize(
    ("defaults", "own", "scale"),
    [
        ("unit: mm", "scale: 2", 2.0),
        ("scale: 2", "unit: mm", 1e-3),
        ("scale: 2", "mass: 1", 2.0),
        ("unit: mm", "unit: cm", 1e-2),
    ],
)
def test_an_own_unit_or_scale_goes_before_the_default(
    tmp_path: Path, defaults: str, own: str, scale: float
) -> None:
    text = f"version: 1\ndefaults: {{{defaults}}}\nobjects: {{a: {{mesh: a.obj, {own}}}}}"
    assert sources(tmp_path, text)["a"].scale == scale


def test_paths_start_from_the_document(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(tmp_path, "version: 1\nobjects: {a: {mesh: a.obj}, b: {mesh: /scans/b.obj}}")
    monkeypatch.chdir("/")
    a, b = load_recipe(tmp_path / "objects.yaml").sources()
    assert (a.mesh, b.mesh) == (tmp_path / "a.obj", Path("/scans/b.obj"))


def test_a_recipe_comes_back_as_it_was_saved(tmp_path: Path) -> None:
    document = RecipeDocument(
        name="kitchen",
        defaults=Defaults(scale=0.01, decomposition=Cutting(threshold=0.1)),
        objects={
            "mug": RecipeObject(mesh="mug.obj", mass=0.1, inertia=(1e-4, 1e-4, 1e-4, 0, 0, 0)),
            "tray": RecipeObject(mesh="tray.obj", unit="in", openings="close", density=900.0),
        },
    )  # fmt: skip
    path = tmp_path / "objects.yaml"
    save_document(document, path)
    assert load_recipe(path).document == document


def one(lines: str) -> str:
    return f"version: 1\nobjects:\n  mug:\n    mesh: mug.obj\n{lines}"


KNOWN = (
    "center_of_mass, contact, decomposition, density, description, friction, inertia, mass,"
    " mesh, openings, pieces, rgba, scale, unit, wall_thickness"
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "FILE: the document is empty"),
        ("- 1\n", "FILE:1: expected keys with values ('key: value' lines)"),
        ("objects: {}\n", "FILE:1: version: missing; add 'version: 1'"),
        ("version: 2\n", "FILE:1: version: 2 cannot be read; this release reads version 1"),
        ("version: 1\n",
         "FILE: objects is empty; add lines such as 'mug: {mesh: mug.obj}'"),
        ("version: 1\nobject: {}\n",
         "FILE:2: unknown key 'object'; did you mean 'objects'? Known: defaults, name, objects,"
         " version"),
        ("version: 1\nobjects:\n- mug.obj\n",
         "FILE:3: objects: expected keys with values ('key: value' lines)"),
        ("version: 1\nobjects:\n  mug: mug.obj\n",
         "FILE:3: objects.mug: expected keys with values ('key: value' lines)"),
        ("version: 1\nobjects:\n  mug: {mass: 0.1}\n",
         "FILE:3: objects.mug: key 'mesh' is missing"),
        ("version: 1\nobjects:\n  mug: {mesh: ''}\n",
         "FILE:3: objects.mug: mesh is empty; give a mesh file"),
        ("version: 1\nobjects:\n  a: {mesh: a.obj}\n  My Mug: {mesh: b.obj}\n",
         ("FILE:4: objects: 'My Mug' is not a valid object name; use a-z, 0-9 and"
             " underscores, such as 'my_mug'")),
        ("version: 1\nobjects:\n  '---': {mesh: a.obj}\n",
         "FILE:3: objects: '---' is not a valid object name; use a-z, 0-9 and underscores"),
        ("version: 1\nobjects:\n  a: {mesh: a.obj}\n  a: {mesh: b.obj}\n",
         "FILE:4: objects: key 'a' is given twice"),
        (one("    freight: 0.4\n"), f"FILE:5: objects.mug: unknown key 'freight'; known: {KNOWN}"),
        (one("    masses: 0.4\n"),
         f"FILE:5: objects.mug: unknown key 'masses'; did you mean 'mass'? Known: {KNOWN}"),
        (one("    mass: 100 g\n"), "FILE:5: objects.mug.mass: '100 g' is not a finite number"),
        (one("    mass: 0\n"),
         "FILE:4: objects.mug: mass is 0 kg; it must be above 0 (leave it out to use a density)"),
        (one("    density: -1\n"), "FILE:4: objects.mug: density is -1 kg/m^3; it must be above 0"),
        (one("    scale: 0\n"), "FILE:4: objects.mug: scale is 0; it must be above 0"),
        (one("    wall_thickness: 0\n"),
         "FILE:4: objects.mug: wall_thickness is 0 m; it must be above 0"),
        (one("    friction: -0.1\n"),
         "FILE:4: objects.mug: friction is -0.1; it must be at least 0"),
        (one("    mass: 0.1\n    density: 800\n"),
         "FILE:4: objects.mug: give mass or density, not both"),
        (one("    unit: mm\n    scale: 0.001\n"),
         "FILE:4: objects.mug: give unit or scale, not both"),
        (one("    unit: inch\n"),
         "FILE:5: objects.mug.unit: 'inch' is not valid; did you mean 'in'? Known: cm, in, m, mm"),
        (one("    openings: closed\n"),
         "FILE:5: objects.mug.openings: 'closed' is not valid; did you mean 'close'? Known: close,"
         " wall"),
        (one("    contact: hull\n"),
         "FILE:5: objects.mug.contact: 'hull' is not valid; known: compliant_pieces, mesh, pieces,"
         " primitive, surface"),
        (one("    center_of_mass: [0, 0]\n"),
         "FILE:5: objects.mug.center_of_mass: has 2 entries; expected 3"),
        (one("    inertia: [1, 1, 1]\n"),
         "FILE:5: objects.mug.inertia: has 3 entries; expected 6"),
        (one("    inertia: [1, 1, 0, 0, 0, 0]\n"),
         ("FILE:4: objects.mug: inertia is [1.0, 1.0, 0.0, 0.0, 0.0, 0.0]; its moments"
             " Ixx, Iyy and Izz must be above 0")),
        (one("    rgba: [1, 0, 0, 255]\n"),
         "FILE:4: objects.mug: rgba is [1.0, 0.0, 0.0, 255.0]; each number must be from 0 to 1"),
        (one("    decomposition: {thresh: 0.1}\n"),
         "FILE:5: objects.mug.decomposition: unknown key 'thresh'; did you mean 'threshold'? Known:"
         " join, max_vertices, min_thickness, seed, threshold, timeout, tolerance"),
        (one("    decomposition: {seed: 0.5}\n"),
         "FILE:5: objects.mug.decomposition.seed: '0.5' is not a whole number"),
        ("version: 1\ndefaults: {mass: 1}\n" + one("")[11:],
         "FILE:2: defaults: unknown key 'mass'; known: contact, decomposition, density, friction,"
         " openings, rgba, scale, unit, wall_thickness"),
        ("version: 1\ndefaults:\n  unit: mm\n  scale: 1\n" + one("")[11:],
         "FILE:3: defaults: give unit or scale, not both"),
    ],
)  # fmt: skip
def test_messages_name_file_line_key_and_remedy(tmp_path: Path, text: str, message: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(DocumentError) as caught:
        load_recipe(path)
    assert str(caught.value) == message.replace("FILE", str(path))


def test_pieces_of_ones_own(tmp_path: Path) -> None:
    """Two boxes make an L, in millimetres; they are taken as they are."""
    bars = [trimesh.creation.box((60, 10, 10)), trimesh.creation.box((10, 60, 10))]
    bars[1].apply_translation((-25, 35, 0))
    for k, bar in enumerate(bars):
        bar.export(tmp_path / f"bar{k}.stl")
    trimesh.util.concatenate(bars).export(tmp_path / "l.stl")
    (tmp_path / "objects.yaml").write_text(
        "version: 1\nobjects:\n"
        "  l: {mesh: l.stl, mass: 0.1, pieces: [bar0.stl, bar1.stl]}\n"
        "  gone: {mesh: l.stl, unit: mm, mass: 0.1, pieces: [bar0.stl, gone.stl]}\n"
    )
    sources = load_recipe(tmp_path / "objects.yaml").sources()
    sources[0] = replace(sources[0], scale=0.001)  # as --unit l=mm does
    report = build_library(sources, tmp_path / "library", confirm=False)
    assert list(report.failed) == ["gone"] and "gone.stl" in report.failed["gone"]
    entry = report.library.entry("l")
    assert entry.decomposition is None and len(entry.pieces) == 2
    pieces = [trimesh.load_mesh(report.library.root / piece) for piece in entry.pieces]
    assert [p.volume for p in pieces] == pytest.approx([6e-6, 6e-6])
