"""`burg-drake schema`: lists kinds of documents, prints a schema, writes one or all."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from burg_drake.apps import main


def test_kinds_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    assert "scene          A scene: objects of a library on a printed board" in (
        capsys.readouterr().out
    )


def test_one_is_printed_or_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema", "scene"]) == 0
    printed = capsys.readouterr().out
    assert json.loads(printed)["required"] == ["version", "name", "library"]
    assert main(["schema", "scene", "-o", str(tmp_path / "a.json")]) == 0
    assert (tmp_path / "a.json").read_text("utf-8") == printed


def test_all_are_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema", "-o", str(tmp_path / "all")]) == 0
    files = sorted(path.name for path in (tmp_path / "all").iterdir())
    assert "station.json" in files
    assert capsys.readouterr().out == f"wrote {len(files)} schemas to {tmp_path / 'all'}\n"


def test_another_kind_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["schema", "scen"])
    assert "did you mean 'scene'?" in capsys.readouterr().err
