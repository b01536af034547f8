"""`burg-drake scene export`."""

from __future__ import annotations

from pathlib import Path

import pytest

from burg_drake.apps import scene_export
from burg_drake.apps.cli import main
from burg_drake.export.export import FORMATS


def test_formats_are_those_of_the_room() -> None:
    assert list(scene_export.FORMATS) == list(FORMATS)


def test_export_says_what_it_wrote(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    arguments = ["scene", "export", str(scene_file), "--to", "dmd", "-o", str(out)]
    assert main([*arguments, "--station", "panda_bin"]) == 0
    wrote = capsys.readouterr().out
    assert wrote.startswith(f"wrote {out / 'scene.dmd.yaml'}: 2 objects, table, ")
    assert main(arguments) == 0  # over itself
    assert capsys.readouterr().out == f"wrote {out / 'scene.dmd.yaml'}: 2 objects\n"


def test_the_folder_of_the_scene_is_refused(
    scene_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["scene", "export", str(scene_file), "--to", "sdf", "-o", str(scene_file.parent)]
    assert main(arguments) == 2
    assert "has files in it and is no earlier export" in capsys.readouterr().err
    assert scene_file.exists()
