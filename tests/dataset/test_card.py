"""The card of a data set, and its pictures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest

from burg_drake.core import InvalidInputError
from burg_drake.dataset import write_card
from tests.dataset.exported_files import image
from tests.dataset.polyhedra import InMemory, some_grasps


def test_card_counts(samples: InMemory, tmp_path: Path) -> None:
    made = InMemory(
        (replace(samples[0], grasps=some_grasps()), *samples.samples[1:]), samples.library
    )
    for _ in range(2):  # a card may be replaced
        write_card(made, tmp_path, facts={"seed": "7"}, licences={"box": "CC0-1.0"})
    text = (tmp_path / "README.md").read_text()
    assert "# bodies" in text and "| scenes | 2 |" in text and "| samples | 4 |" in text
    assert "| 1 | gem | 6 | 6 | gem.stl | gem000000000 | not stated |" in text
    assert "| 2 | box | 4 | 4 | box.stl | box000000000 | CC0-1.0 |" in text
    assert "| lifted | 2 |" in text and "| seed | 7 |" in text and "| burg_drake |" in text
    for name in ("distance", "elevation", "visibility", "objects"):
        assert f"card/{name}.svg" in text
        tree = ElementTree.parse(tmp_path / "card" / f"{name}.svg")
        bars = [b for b in tree.iter() if b.tag.endswith("rect")][1:]
        assert max(float(bar.attrib["height"]) for bar in bars) == pytest.approx(130.0)
    assert [float(b.attrib["height"]) for b in bars] == [0, 0, 130, 130]  # 2 and 3 objects
    assert image(tmp_path / "card/examples.png").shape[1] > 960


def test_card_does_not_replace_what_is_not_its_own(samples: InMemory, tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text("mine")
    with pytest.raises(InvalidInputError, match="not the card"):
        write_card(samples, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["README.md"]
