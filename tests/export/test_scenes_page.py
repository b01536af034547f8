"""The Python of the section on exports in docs/scenes.md runs as it is printed."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "scenes.md"


def test_every_block_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    section = PAGE.read_text("utf-8").partition("\n## Exporting\n")[2].partition("\n## ")[0]
    blocks = re.findall(r"```python\n(.*?)```\n", section, re.DOTALL)
    assert len(blocks) == 2
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(compile("\n".join(blocks), str(PAGE), "exec"), names)
    plant = names["plant"]
    plant.Finalize()  # type: ignore[attr-defined]
    assert plant.num_bodies() == 1 + 6 + 1  # type: ignore[attr-defined]
    assert (tmp_path / "tabletop_mjcf" / "scene.xml").is_file()
