"""Scene documents: loading, lookup, and what their hash depends on."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import DocumentError, UnknownNameError
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import Instance, Scene, load_scene, save_scene

MakeScene = Callable[..., Scene]

TEXT = """\
version: 1
name: by_hand
library: boxes
instances:
  - {object: cube, X_SO: {translation: [0.3, 0.2, 0.0], rpy_deg: [0, 0, 90]}}
  - {name: second, object: cube}
background:
  - {object: slab}
"""


@pytest.fixture
def by_hand(library: ObjectLibrary, tmp_path: Path) -> Path:
    path = tmp_path / "by_hand.yaml"
    path.write_text(TEXT)
    return path


def test_lookup(by_hand: Path) -> None:
    scene = load_scene(by_hand)
    assert list(scene.instances) == ["cube", "second"]
    assert list(scene.background) == ["slab"]
    assert scene.board.size == (0.594, 0.420)
    assert scene.entry("second").mass == 0.1
    expected = [[0, -1, 0, 0.3], [1, 0, 0, 0.2], [0, 0, 1, 0], [0, 0, 0, 1]]
    assert np.allclose(scene.X_SO("cube"), expected, atol=1e-15)
    with pytest.raises(UnknownNameError, match=r"has no 'sekond'; did you mean 'second'\?"):
        scene.instance("sekond")


def edit(path: Path, old: str, new: str) -> Path:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return path


@pytest.mark.parametrize(
    ("old", "new", "error", "message"),
    [
        ("object: slab", "object: slap", UnknownNameError, "background[0]: object 'slap'"),
        (
            "{object: slab}",
            "{name: second, object: slab}",
            DocumentError,
            "'second' is used already",
        ),
        ("[0.3, 0.2, 0.0]", "[0.3, .nan, 0.0]", DocumentError, "'.nan' is not a finite number"),
        ("library: boxes", "library: bocks", UnknownNameError, "by_hand.yaml: library: bocks does"),
        ("name: second", "name: a/b", DocumentError, "instances[1]: name 'a/b' cannot be used in"),
        ("name: by_hand", "nam: by_hand", DocumentError, "unknown key 'nam'; did you mean 'name'?"),
        ("instances:", "board: {size: [0, 1]}\ninstances:", DocumentError, "must be above 0"),
    ],
)
def test_mistakes_are_named(
    by_hand: Path, old: str, new: str, error: type[Exception], message: str
) -> None:
    with pytest.raises(error) as caught:
        load_scene(edit(by_hand, old, new))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_round_trip(by_hand: Path, tmp_path: Path) -> None:
    scene = load_scene(by_hand)
    save_scene(scene.document, tmp_path / "copy.yaml")
    copy = load_scene(tmp_path / "copy.yaml")
    assert copy.document == scene.document
    assert copy.content == scene.content


def test_content_follows_placement_and_objects_alone(make_scene: MakeScene) -> None:
    scene = make_scene(("cube", (0.3, 0.2, 0.0)))
    renamed = dataclasses.replace(scene.document, name="other", description="text", library="x")
    assert Scene(renamed, scene.library, Path("elsewhere.yaml")).content == scene.content
    moved = make_scene(("cube", (0.3, 0.2, 1e-6)))
    assert moved.content != scene.content
    entry = dataclasses.replace(scene.library.entry("cube"), build="another")
    objects = {**scene.library.objects, "cube": entry}
    rebuilt = ObjectLibrary(
        dataclasses.replace(scene.library.document, objects=objects), scene.library.root
    )
    assert Scene(scene.document, rebuilt, scene.path).content != scene.content


def test_an_unused_object_does_not_count(make_scene: MakeScene) -> None:
    scene = make_scene(("cube", (0.3, 0.2, 0.0)))
    entry = dataclasses.replace(scene.library.entry("slab"), build="another")
    library = ObjectLibrary(
        dataclasses.replace(
            scene.library.document, objects={**scene.library.objects, "slab": entry}
        ),
        scene.library.root,
    )
    assert Scene(scene.document, library, scene.path).content == scene.content


def test_unnamed_instances_go_by_their_object() -> None:
    assert Instance(object="cube").X_SO.matrix() == pytest.approx(np.eye(4))


def test_what_has_no_mass_cannot_be_free(make_scene: MakeScene, library: ObjectLibrary) -> None:
    cube = library.objects["cube"]
    fixed = dataclasses.replace(cube.mass_properties, source="fixed")
    library.objects["cube"] = dataclasses.replace(cube, mass_properties=fixed)
    library.save()
    assert list(make_scene(background=(("cube",),)).background) == ["fixed_0"]
    with pytest.raises(
        DocumentError,
        match=r"instances\[0\]: 'cube' has no mass.* background",
    ):
        make_scene(("cube",))
