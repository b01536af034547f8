"""Scenes of BURG-Toolkit as documents: names of objects and of their instances."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import InvalidInputError, Pose, UnknownNameError
from burg_drake.formats import BurgInstance, BurgMarkers, BurgPrintout, BurgScene
from burg_drake.objects import load_library
from burg_drake.pipeline import import_burg_scene
from burg_drake.station import MODEL_NAMES


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
    document = import_burg_scene(
        scene(("Mug", "box", "mug", "MUG"), ("box",)), library, "kitchen", "../household"
    ).document
    assert (document.name, document.library) == ("kitchen", "../household")
    assert document.board.size == (0.42, 0.297)
    assert [(i.name, i.object) for i in document.instances] == [
        ("", "mug"), ("", "box"), ("mug_2", "mug"), ("mug_3", "mug"),
    ]  # fmt: skip
    assert [(i.name, i.object) for i in document.background] == [("box_2", "box")]
    assert document.instances[2].X_SO.translation == (0.2, 0.0, 0.0)
    assert import_burg_scene(scene(()), library).document.name == "scene"


def test_an_object_that_is_called_like_an_instance() -> None:
    library = load_library("household")
    library.document.objects["mug_2"] = library.objects["mug"]
    document = import_burg_scene(scene(("mug", "mug", "mug_2")), library).document
    assert [(i.name, i.object) for i in document.instances] == [
        ("", "mug"), ("mug_3", "mug"), ("", "mug_2"),
    ]  # fmt: skip


def test_an_object_that_the_library_lacks() -> None:
    message = r"there/scene.yaml:11: object 'mugg' \('Mugg'\) is not in .*; did you mean 'mug'\?"
    with pytest.raises(UnknownNameError, match=message):
        import_burg_scene(scene(("mug", "Mugg")), load_library("household"))


def test_all_objects_that_the_library_lacks_are_named() -> None:
    with pytest.raises(UnknownNameError) as caught:
        import_burg_scene(scene(("mug", "Mugg"), ("shelf",)), load_library("household"))
    assert [f"scene.yaml:{line}: object" in str(caught.value) for line in (10, 11)] == [True, True]


def test_an_instance_is_not_called_like_something_of_every_station() -> None:
    library = load_library("household")
    for name in MODEL_NAMES:
        library.document.objects[name] = library.objects["box"]
    imported = import_burg_scene(scene(("mug",), (*MODEL_NAMES, "table")), library)
    names = [i.name for i in imported.document.background]
    assert names == [*(f"{name}_1" for name in MODEL_NAMES), "table_2"]
    assert imported.notes[0] == (
        "an instance of object 'table' is called 'table_1', as every station has"
        " something called 'table' already"
    )


def test_what_has_no_mass_is_background() -> None:
    library = load_library("household")
    box = library.objects["box"]
    fixed = dataclasses.replace(box.mass_properties, source="fixed")
    library.document.objects["box"] = dataclasses.replace(box, mass_properties=fixed)
    imported = import_burg_scene(scene(("mug", "box")), library)
    assert [i.object for i in imported.document.instances] == ["mug"]
    assert [i.object for i in imported.document.background] == ["box"]
    assert imported.notes == (
        "there/scene.yaml:11: 'box' has no mass, so it becomes background, which does not move",
    )


MARKERS = BurgMarkers(
    aruco_dict="DICT_4X4_250",
    marker_count_x=7,
    marker_count_y=5,
    marker_size_mm=57.0,
    marker_spacing_mm=19.0,
)
PRINTOUT = BurgPrintout(size=(0.594, 0.42), marker_info=MARKERS)


def test_the_printed_board() -> None:
    """BURG-Toolkit's default on A2: the border of its grid is half of what 7 x 5 markers leave."""
    printed = dataclasses.replace(scene(("mug",)), printout=PRINTOUT)
    board = import_burg_scene(printed, load_library("household")).document.board
    layout = board.layout
    assert (board.size, layout.dictionary, layout.ids.tolist()) == (
        (0.594, 0.42), "4X4_250", list(range(35)),
    )  # fmt: skip
    left, bottom = (0.594 - 7 * 0.076 + 0.019) / 2, (0.42 - 5 * 0.076 + 0.019) / 2
    first = np.array([left, bottom + 4 * 0.076 + 0.057, 0.0])
    np.testing.assert_allclose(layout.p_SQ[0, 0], first, atol=1e-12)
    np.testing.assert_allclose(layout.p_SQ[28, 3], [left, bottom, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"aruco_dict": "DICT_4X4_25"},
            "there/scene.yaml: printout: marker dictionary '4X4_25' does",
        ),
        ({"marker_count_x": 9}, "there/scene.yaml: printout: markers of 57 mm .* do not fit"),
    ],
)
def test_a_board_that_cannot_be(change: dict[str, object], message: str) -> None:
    printout = dataclasses.replace(PRINTOUT, marker_info=dataclasses.replace(MARKERS, **change))
    printed = dataclasses.replace(scene(()), printout=printout)
    with pytest.raises(InvalidInputError, match=message):
        import_burg_scene(printed, load_library("household"))
