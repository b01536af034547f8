"""docs/reference/grasp_formats.md says of each format what the format says of itself."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from burg_drake.formats import GRASP_FORMATS, PANDA_GRIPPER, convention_of

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "grasp_formats.md"


@pytest.fixture(scope="module")
def page() -> str:
    return PAGE.read_text(encoding="utf-8")


def anchor(title: str) -> str:
    """Of a heading, as GitHub makes it."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


@pytest.mark.parametrize("name", GRASP_FORMATS)
def test_tables_are_in_step(page: str, name: str) -> None:
    format = GRASP_FORMATS[name]
    frame = convention_of(format, PANDA_GRIPPER)
    cells = [
        f"[{format.title}](#{anchor(format.title)})",
        f"`{name}`",
        format.frame,
        frame.approach,
        frame.closing,
        frame.origin,
    ]
    lines = page.splitlines()
    assert f"| {' | '.join(cells)} |" in lines
    cells = [
        format.title,
        " ".join(f"`{suffix}`" for suffix in format.suffixes),
        ", ".join(format.carries) or "poses only",
        ", ".join(format.cannot_carry) or "nothing",
    ]
    assert f"| {' | '.join(cells)} |" in lines


@pytest.mark.parametrize("name", GRASP_FORMATS)
def test_each_format_has_a_section_with_its_source(page: str, name: str) -> None:
    section = page.split(f"\n## {GRASP_FORMATS[name].title}\n")[1].split("\n## ")[0]
    assert GRASP_FORMATS[name].source in " ".join(section.split())


def test_no_row_is_left_of_a_format_that_is_gone(page: str) -> None:
    rows = [line for line in page.splitlines() if line.startswith("| [")]
    assert len(rows) == len(GRASP_FORMATS)
