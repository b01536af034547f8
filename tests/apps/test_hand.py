"""`burg-drake hand`: what there is, and whether a document of one's own fits its model."""

from __future__ import annotations

from pathlib import Path

import pytest

from burg_drake.apps import main
from burg_drake.core import builtin_names, resolve_reference

Capture = pytest.CaptureFixture[str]


def test_list_names_every_built_in_hand(capsys: Capture) -> None:
    assert main(["hand", "list"]) == 0
    _, _, *lines = capsys.readouterr().out.splitlines()
    names = [line.split()[0] for line in lines if not line.startswith(" ")]
    assert names == builtin_names("models/hands")
    assert "Franka Hand" in lines[0]


def test_check_says_what_the_hand_measures(capsys: Capture) -> None:
    assert main(["hand", "check", "wsg_50"]) == 0
    out = capsys.readouterr().out
    for figure in ("0.0 to 110.0 mm", "20.0 x 20.0 mm, 8.0 mm thick", "30 N", "50 mm/s", "coupled"):
        assert figure in out


def test_check_of_an_own_document(tmp_path: Path, capsys: Capture) -> None:
    text = resolve_reference("wsg_50", "models/hands").read_text(encoding="utf-8")
    own = tmp_path / "my_hand.yaml"
    own.write_text(text.replace("name: wsg_50", "name: mine"), encoding="utf-8")
    assert main(["hand", "check", str(own)]) == 0
    assert capsys.readouterr().out.startswith("mine: the document agrees with ")
    own.write_text(text.replace("opening: [0.0, 0.11]", "opening: [0.0, 0.1]"), encoding="utf-8")
    assert main(["hand", "check", str(own)]) == 2
    assert "the pads are 110.0 mm apart along x of G, but opening says 100.0 mm" in (
        capsys.readouterr().err
    )
