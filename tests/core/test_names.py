"""Names that become parts of paths, in every document that has one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from burg_drake.core import DocumentError, InvalidInputError, data_root, make_name, require_name
from burg_drake.objects import load_library
from burg_drake.pipeline import load_recipe
from burg_drake.scene import load_scene
from burg_drake.station import load_hand, load_station

RECIPE = "version: 1\nname: mine\nobjects:\n  a: {mesh: a.obj}\n"


@pytest.mark.parametrize("name", ["a", "mug_2", "Ä-1.0", "x" * 100])
def test_names(name: str) -> None:
    require_name(name)
    assert make_name(name) == name


@pytest.mark.parametrize(
    "name",
    ["", ".", "..", "../x", "a/b", "/a", ".a", "a b", "a\n", "a\0", "~", "x" * 101, "ä" * 51],
)
def test_what_is_no_name(name: str) -> None:
    with pytest.raises(InvalidInputError, match="cannot be used in paths"):
        require_name(name)
    require_name(make_name(name))


def built_in(place: str) -> str:
    return (data_root() / place).read_text()


@pytest.mark.parametrize(
    ("text", "old", "line", "load"),
    [
        (built_in("scenes/tabletop_six.yaml"), "tabletop_six", "name: ", load_scene),
        (built_in("stations/panda_tabletop.yaml"), "panda_tabletop", "name: ", load_station),
        (built_in("stations/panda_tabletop.yaml"), "board", "  board:", load_station),
        (built_in("models/hands/panda_hand.yaml"), "panda_hand", "name: ", load_hand),
        (built_in("models/household/library.yaml"), "household", "name: ", load_library),
        (built_in("models/household/library.yaml"), "mug", "  mug:", load_library),
        (RECIPE, "mine", "name: ", load_recipe),
    ],
)
def test_documents_name_no_other_folder(
    tmp_path: Path, text: str, old: str, line: str, load: Callable[[Path], Any]
) -> None:
    lines = text.splitlines(keepends=True)
    number = next(i for i, given in enumerate(lines) if given.startswith(line))
    lines[number] = lines[number].replace(old, "../../../../x", 1)
    path = tmp_path / "library.yaml"
    path.write_text("".join(lines))
    with pytest.raises(DocumentError) as raised:
        load(path)
    said = str(raised.value)
    assert "name '../../../../x' cannot be used in paths" in said
    assert any(said.startswith(f"{path}:{n}:") for n in (number + 1, number + 2))
