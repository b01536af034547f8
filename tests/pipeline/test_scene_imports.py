"""Scenes of BURG-Toolkit as documents: names of objects and of their instances."""

from __future__ import annotations

from pathlib import Path

import pytest

from burg_drake.core.errors import UnknownNameError
from burg_drake.core.schema import Pose
from burg_drake.formats.burg_scene import BurgInstance, BurgScene
from burg_drake.objects.library import load_library
from burg_drake.pipeline.scene_imports import burg_scene_document


def placed(*types: str) -> tuple[BurgInstance, ...]:
    return tuple(
        BurgInstance(object_type=t, X_SO=Pose((0.1 * k, 0.0, 0.0)), line=10 + k)
        for k, t in enumerate(types)
    )


def scene(free: tuple[str, ...], fixed: tuple[str, ...] = ()) -> BurgScene:
    return BurgScene(
        path=Path("there/scene.yaml"),
        ground_area=(0.42, 0.297),
        objects=placed(*free),
        bg_objects=placed(*fixed),
    )


def test_objects_and_instances_get_names() -> None:
    library = load_library("household")
    document = burg_scene_document(
        scene(("Mug", "box", "mug", "MUG"), ("box",)), library, "kitchen", "../household"
    )
    assert (document.name, document.library) == ("kitchen", "../household")
    assert document.board.size == (0.42, 0.297)
    assert [(i.name, i.object) for i in document.instances] == [
        ("", "mug"), ("", "box"), ("mug_2", "mug"), ("mug_3", "mug"),
    ]  # fmt: skip
    assert [(i.name, i.object) for i in document.background] == [("box_2", "box")]
    assert document.instances[2].X_SO.translation == (0.2, 0.0, 0.0)
    assert burg_scene_document(scene(()), library).name == "scene"


def test_an_object_that_is_called_like_an_instance() -> None:
    library = load_library("household")
    library.document.objects["mug_2"] = library.objects["mug"]
    document = burg_scene_document(scene(("mug", "mug", "mug_2")), library)
    assert [(i.name, i.object) for i in document.instances] == [
        ("", "mug"), ("mug_3", "mug"), ("", "mug_2"),
    ]  # fmt: skip


def test_an_object_that_the_library_lacks() -> None:
    message = r"there/scene.yaml:11: object 'mugg' \('Mugg'\) is not in .*; did you mean 'mug'\?"
    with pytest.raises(UnknownNameError, match=message):
        burg_scene_document(scene(("mug", "Mugg")), load_library("household"))
