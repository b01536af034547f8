"""Public names: few on the main road, each in one face, and none that only the source tells of."""

from __future__ import annotations

import ast
import re
from functools import cache
from inspect import isclass, isroutine
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import burg_drake as burg
from burg_drake.scene import ObjectShapes
from tests.pages import PAGES, ROOT, blocks
from tests.public_types import project_types
from tools import site

PACKAGE = Path(burg.__file__).parent
FACES = sorted(name for name in burg.__all__ if isinstance(getattr(burg, name), ModuleType))
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
DOTTED = r"burg(\.\w+)+"
WITH_PYTHON = [page for page in PAGES if any(block.language == "python" for block in blocks(page))]


@cache
def public_names() -> dict[str, dict[str, Any]]:
    """Public names and what they are, by face; that of `burg_drake` itself is ''."""
    faces = {"": burg, **{name: getattr(burg, name) for name in FACES}}
    return {name: names_of(face) for name, face in faces.items()}


def names_of(face: ModuleType) -> dict[str, Any]:
    listed = getattr(face, "__all__", None) or [name for name in vars(face) if name[0] != "_"]
    values = {name: getattr(face, name) for name in listed}
    return {name: value for name, value in values.items() if not isinstance(value, ModuleType)}


def test_the_main_road_is_short() -> None:
    assert len(public_names()[""]) <= 54


def test_a_name_is_in_one_face() -> None:
    where: dict[str, list[str]] = {}
    for face, names in public_names().items():
        for name in names:
            where.setdefault(name, []).append(face)
    assert {name: faces for name, faces in where.items() if len(faces) > 1} == {}


@pytest.mark.parametrize("face", ["", *FACES])
def test_types_in_public_signatures_are_public(face: str) -> None:
    public = {id(value) for names in public_names().values() for value in names.values()}
    missing = {
        f"{found.__module__}.{found.__name__}": where
        for value in public_names()[face].values()
        for where, found in project_types(value)
        if id(found) not in public
    }
    assert missing == {}


@pytest.mark.parametrize(
    ("value", "where", "found"),
    [
        (burg.ArmTrial, "ArmTrial.hand", "MountedHand"),  # annotation of a plain class
        (burg.ArmTrial, "ArmTrial.diagram", "StationDiagram"),  # inherited
        (burg.cameras.LiveSession, "LiveSession.picture", "Picture"),
        (burg.scenes.SceneOrigin, "SceneOrigin.differences", "SamplingProvenance"),
        (burg.compose.ComposeSession, "ComposeSession.settle", "BackgroundJob"),  # generic
        (burg.arm.ArmSpan, "ArmSpan.of", "ArmKinematics"),
        (ObjectShapes, "ObjectShapes.__getitem__", "ObjectShape"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_all_that_a_class_says_is_seen(value: type, where: str, found: str) -> None:
    assert (where, found) in {(place, one.__name__) for place, one in project_types(value)}


def test_the_site_groups_all_names_of_the_main_road() -> None:
    listed = [name for names in site.MAIN_NAMES.values() for name in names.split()]
    assert sorted(listed) == sorted(public_names()[""])


@pytest.mark.parametrize("face", ["", *FACES])
def test_docstrings_begin_with_a_sentence(face: str) -> None:
    values = {n: v for n, v in public_names()[face].items() if isroutine(v) or isclass(v)}
    begins = {name: (value.__doc__ or "").partition("\n")[0] for name, value in values.items()}
    assert {n: line for n, line in begins.items() if not re.fullmatch(r"[A-Z0-9`].*\.", line)} == {}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples_use_public_names_only(path: Path) -> None:
    assert private_names(ast.parse(path.read_text("utf-8"))) == []


@pytest.mark.parametrize("page", WITH_PYTHON, ids=lambda page: page.stem)
def test_pages_use_public_names_only(page: Path) -> None:
    python = [block for block in blocks(page) if block.language == "python"]
    assert [name for block in python for name in private_names(block.module)] == []


def private_names(module: ast.Module) -> list[str]:
    """What a program takes from burg_drake that no face has."""
    taken = []
    for node in ast.walk(module):
        if isinstance(node, ast.ImportFrom) and node.module:
            taken += [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            taken += [alias.name for alias in node.names]
        elif isinstance(node, ast.Attribute):
            name = ast.unparse(node)
            taken += [re.sub("^burg", "burg_drake", name)] if re.fullmatch(DOTTED, name) else []
    public = {"burg_drake", "burg_drake.__version__", *(f"burg_drake.{face}" for face in FACES)}
    for face, names in public_names().items():
        public |= {".".join(filter(None, ("burg_drake", face, name))) for name in names}
    return [
        name
        for name in taken
        if re.match(r"burg_drake\b", name)
        and not any(name == one or (name.startswith(f"{one}.") and is_value(one)) for one in public)
    ]


def is_value(name: str) -> bool:
    """Whether a public name has attributes of its own, as classes do, instead of being a face."""
    return name != "burg_drake" and name.removeprefix("burg_drake.") not in FACES


def test_rooms_do_not_import_faces() -> None:
    plain = "|".join(name for name in FACES if (PACKAGE / f"{name}.py").is_file())
    imports = re.compile(rf"(from|import) burg_drake(\.({plain}) | import ({plain})\b)")
    for path in PACKAGE.rglob("*.py"):
        assert not imports.search(path.read_text("utf-8")), path
