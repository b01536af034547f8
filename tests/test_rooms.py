"""The order of the house: imports between and within rooms point one way and go through faces.

What a rule finds is shown on small packages that break it.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from tests.imports import HOUSE, Import, Package
from tests.rules import (
    beside_faces,
    defined_twice,
    eager,
    imports_drake,
    loaded_with,
    many_parameters,
    unasked,
    unplaced,
    upward,
    wrong_faces,
)

ARCHITECTURE = Path(__file__).parents[1] / "ARCHITECTURE.md"
ROOMS = [
    "core",
    "geometry",
    "formats",
    "objects",
    "scene",
    "printout",
    "station",
    "export",
    "cameras",
    "ros",
    "grasping",
    "motion",
    "simulation",
    "pipeline",
    "visualization",
    "evaluation",
    "generation",
    "dataset",
    "experiment",
    "benchmark",
    "compose",
    "ui",
    "apps",
]
"""Rooms. A room imports those before it and itself."""
ELSEWHERE = ("tests", "benchmarks", "tools")
"""Folders of the project whose files import from faces."""
WITHOUT_DRAKE = [
    "core",
    "geometry",
    "formats",
    "objects",
    "scene",
    "printout",
    "export",
    "compose",
    "ros",
]
"""Rooms that never import pydrake."""
LIGHT = {"numpy", "rich", "lazy_loader"}
"""What the command line may load before it knows what is asked."""


# --- the house ------------------------------------------------------------------------------------


def test_every_package_has_its_place() -> None:
    assert unplaced(HOUSE, ROOMS) == []


def test_imports_point_to_what_comes_before() -> None:
    assert upward(HOUSE, ROOMS) == []


def test_no_modules_need_each_other() -> None:
    assert HOUSE.circles() == []


def test_imports_from_elsewhere_go_through_faces() -> None:
    assert beside_faces(HOUSE) == []


def test_faces_show_what_there_is() -> None:
    assert wrong_faces(HOUSE) == []


def test_tests_import_from_faces() -> None:
    assert beside_faces(HOUSE, HOUSE.imports_of(Path(__file__).parent)) == []


@pytest.mark.skipif(not ARCHITECTURE.exists(), reason="tests of an installed package")
def test_faces_show_what_others_use() -> None:
    outside = [x for name in ELSEWHERE for x in HOUSE.imports_of(ARCHITECTURE.parent / name)]
    assert unasked(HOUSE, outside) == []


def test_one_name_means_one_thing() -> None:
    assert defined_twice(HOUSE) == []


def test_functions_take_few_parameters() -> None:
    assert many_parameters(HOUSE) == []


def test_what_need_not_be_there_is_imported_where_it_is_needed() -> None:
    assert eager(HOUSE) == []


def test_rooms_without_drake() -> None:
    assert imports_drake(HOUSE, WITHOUT_DRAKE) == []


def test_the_command_line_begins_light() -> None:
    assert loaded_with(HOUSE, f"{HOUSE.name}.apps.cli") <= LIGHT


@pytest.mark.skipif(not ARCHITECTURE.exists(), reason="tests of an installed package")
def test_the_table_of_rooms_is_complete_and_in_order() -> None:
    rows = re.findall(r"^\| `(\w+)` \| \w", ARCHITECTURE.read_text("utf-8"), re.MULTILINE)
    assert rows == ROOMS


# --- what the rules find --------------------------------------------------------------------------


def built(tmp_path: Path, **files: str) -> Package:
    """A package `house` of modules with a text, `a_in_low` for low/a.py."""
    for name, text in files.items():
        path = tmp_path.joinpath("house", *name.split("_in_")[::-1]).with_suffix(".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    for folder in [tmp_path / "house", *(tmp_path / "house").rglob("*/")]:
        (folder / "__init__.py").touch()
    return Package(tmp_path / "house")


def face(package: Package, room: str, text: str) -> Package:
    """The same with a stub of a room."""
    (package.folder / room / "__init__.pyi").write_text(text)
    return Package(package.folder)


ORDER = ["low", "high"]


def test_a_room_without_a_place_is_found(tmp_path: Path) -> None:
    house = built(tmp_path, a_in_low="", c_in_attic="", d_in_cellar_in_low="")
    assert unplaced(house, ORDER) == ["attic", "high"]


def test_a_room_that_imports_a_later_one_is_found(tmp_path: Path) -> None:
    house = built(tmp_path, a_in_low="def f():\n    from house.high import g", b_in_high="g = 1")
    house = face(house, "high", "from .b import g as g")
    assert upward(house, ORDER) == ["house.low.a:2 imports g from house.high"]


@pytest.mark.parametrize("back", ["from house.low.a import f", "def h():\n    import house.low.a"])
def test_modules_that_need_each_other_are_found(tmp_path: Path, back: str) -> None:
    house = built(
        tmp_path, a_in_low="from house.low.b import g", b_in_low="from house.low.c import g"
    )
    assert house.circles() == []
    house = built(tmp_path, c_in_low=f"{back}\ng = 1")
    assert house.circles() == [["house.low.a", "house.low.b", "house.low.c"]]


def test_a_circle_through_a_face_is_found(tmp_path: Path) -> None:
    house = built(
        tmp_path, a_in_low="from house.high import g", b_in_high="from house.low import f"
    )
    face(house, "low", "from .a import f as f")
    assert face(house, "high", "from .b import g as g").circles() == [
        ["house.high.b", "house.low.a"]
    ]


@pytest.mark.parametrize(
    "text",
    ["from house.low.a import f", "from house.low import g", "from house.low import a",
     "import house.low.a"],
)  # fmt: skip
def test_an_import_past_a_face_is_found(tmp_path: Path, text: str) -> None:
    house = built(tmp_path, a_in_low="f = g = 1", b_in_high=f"from house.low import f\n{text}")
    found = beside_faces(face(house, "low", "from .a import f as f"))
    assert len(found) == 1 and found[0].startswith("house.high.b:2 imports")


def test_a_test_that_imports_past_a_face_is_found(tmp_path: Path) -> None:
    house = built(tmp_path, a_in_low="f = g = 1", b_in_shelf_in_low="h = 1")
    house = face(house, "low", "from .a import f as f")
    tests = tmp_path / "tests"
    tests.mkdir()
    lines = ["from house.low import f, a", "from house.low.a import g"]
    (tests / "t.py").write_text("\n".join([*lines, "from house.low.shelf import b"]))
    found = beside_faces(house, house.imports_of(tests))
    assert found == ["tests.t:2 imports g from house.low.a"]


def test_a_face_that_shows_what_there_is_not_is_found(tmp_path: Path) -> None:
    house = built(tmp_path, a_in_low="f = 1", g_in_low="g = 1")
    text = "from .a import f as f, h as h\nfrom .g import g as g"
    assert wrong_faces(face(house, "low", text)) == [
        "house.low shows h, which house.low.a does not have",
        "house.low shows g, which is the name of a module",
    ]


def test_a_name_that_nobody_imports_is_found(tmp_path: Path) -> None:
    house = built(
        tmp_path,
        a_in_low="f = g = h = 1",
        b_in_low="from house.low import g",
        c_in_high="from house.low import f",
        e_in_for_users="f = g = 1",
    )
    face(house, "low", "from .a import f as f, g as g, h as h")
    face(house, "for_users", "from .e import f as f, g as g")
    (house.folder / "for_users" / "__init__.py").write_text('__all__ = ["f"]')
    (house.folder / "__init__.pyi").write_text("from . import for_users as for_users")
    assert unasked(Package(house.folder), [Import("t", "house.low", "h", 1)]) == [
        "house.for_users shows g, which nobody imports",
        "house.low shows g, which nobody imports",
    ]


def test_names_of_a_room_that_is_imported_as_a_whole_count(tmp_path: Path) -> None:
    house = built(
        tmp_path, a_in_low="f = g = 1", b_in_low="from house import high\nhigh.h",
        c_in_high="from house import low\nlow.f", d_in_high="h = 1",
    )  # fmt: skip
    house = face(house, "low", "from .a import f as f, g as g")
    house = face(house, "high", "from .d import h as h")
    assert unasked(house) == ["house.low shows g, which nobody imports"]
    assert "house.low.b:2 imports h from house.high" in upward(house, ORDER)


def test_a_class_of_two_meanings_is_found(tmp_path: Path) -> None:
    house = built(tmp_path, a_in_low="class Ball: ...", b_in_high="class Ball: ...")
    assert defined_twice(house) == ["Ball: house.high.b, house.low.a"]


@pytest.mark.parametrize(
    "text",
    ['Ball = Literal["round"]', "Ball = Callable[[int], str]", "Ball = int | None", "Ball = Any",
     "Ball: TypeAlias = int", "Ball: typing.TypeAlias = int", "Ball = Round",
     'Ball = TypeVar("Ball")',
     pytest.param("type Ball = int", marks=pytest.mark.skipif(
         sys.version_info < (3, 12), reason="no such statement"))],
)  # fmt: skip
def test_a_type_of_two_meanings_is_found(tmp_path: Path, text: str) -> None:
    house = built(tmp_path, a_in_low="class Ball: ...", b_in_high=text)
    assert defined_twice(house) == ["Ball: house.high.b, house.low.a"]


def test_a_type_that_is_repeated_is_found(tmp_path: Path) -> None:
    text = "Ball = tuple[int, ...]"
    house = built(tmp_path, a_in_low=text, b_in_high=text)
    assert defined_twice(house) == ["Ball: house.high.b, house.low.a"]


@pytest.mark.parametrize("text", ["_Ball = int | None", "BALL = 1", 'Ball = TypeVar("Ball")'])
def test_what_is_private_or_stands_for_any_type_may_be_repeated(tmp_path: Path, text: str) -> None:
    assert defined_twice(built(tmp_path, a_in_low=text, b_in_high=text)) == []


def test_long_lists_of_parameters_are_found(tmp_path: Path) -> None:
    nine = ", ".join(f"x{k}" for k in range(9))
    methods = f"    def g(self, {nine}): ...\n    def h(self, {nine}, *, y): ..."
    house = built(tmp_path, a_in_low=f"def f({nine}): ...\nclass A:\n{methods}")
    assert many_parameters(house) == ["house.low.a:4 h has 10 parameters"]


def test_eager_imports_are_found(tmp_path: Path) -> None:
    house = built(
        tmp_path,
        a_in_low="if True:\n    import pandas\ndef f():\n    import pyarrow",
        b_in_ui="import viser",
        c_in_apps="from house.low import g\nimport json",
        d_in_low="from pydrake.math import X as g",
    )
    assert eager(house) == ["house.low.a imports pandas at its top"]
    assert imports_drake(house, ["low"]) == ["house.low.d:1 imports pydrake"]
    house = face(house, "low", "from .d import g as g")
    assert loaded_with(house, "house.apps.c") == {"pydrake"}
    (house.folder / "low" / "__init__.py").write_text("from house.low.a import f")
    assert eager(Package(house.folder))[0] == "the face house.low imports house"


def test_an_import_says_where_it_is() -> None:
    assert str(Import("a.b", "c", "d", 3)) == "a.b:3 imports d from c"
