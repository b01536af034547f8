"""Imports between the packages only point one way."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import burg_drake

PACKAGE = Path(burg_drake.__file__).parent
# A room may import itself and the rooms before it.
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
    "experiment",
    "compose",
    "ui",
    "apps",
]


def imported_rooms(path: Path) -> set[str]:
    modules = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            modules |= {f"{node.module}.{alias.name}" for alias in node.names}
    parts = [module.split(".") for module in modules]
    return {name[1] for name in parts if name[0] == "burg_drake" and len(name) > 1} & set(ROOMS)


def test_every_package_is_a_room() -> None:
    packages = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    assert packages <= set(ROOMS)


@pytest.mark.parametrize("room", ROOMS)
def test_imports_point_to_the_rooms_before(room: str) -> None:
    allowed = set(ROOMS[: ROOMS.index(room) + 1])
    for path in (PACKAGE / room).rglob("*.py"):
        assert imported_rooms(path) <= allowed, path
