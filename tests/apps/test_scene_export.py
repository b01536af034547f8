"""`burg-drake scene export`."""

from __future__ import annotations

from pathlib import Path

import pytest

from burg_drake.apps import main


def test_export_says_what_it_wrote(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    arguments = ["scene", "export", str(scene_file), "--to", "dmd", "-o", str(out)]
    assert main([*arguments, "--station", "panda_bin"]) == 0
    wrote, told = capsys.readouterr()
    assert told == ""
    assert wrote.startswith(f"wrote {out / 'scene.dmd.yaml'}: 2 objects, table, ")
    assert main(arguments) == 0  # over itself
    assert capsys.readouterr().out == f"wrote {out / 'scene.dmd.yaml'}: 2 objects\n"


def test_the_folder_of_the_scene_is_refused(
    scene_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["scene", "export", str(scene_file), "--to", "sdf", "-o", str(scene_file.parent)]
    assert main(arguments) == 2
    assert "has files in it and is not an earlier export" in capsys.readouterr().err
    assert scene_file.exists()


def test_a_faulty_scene_is_exported_and_what_is_wrong_is_told(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene_file.write_text(scene_file.read_text().replace("0.12,", "1.2,"))
    arguments = ["scene", "export", str(scene_file), "--to", "dmd", "-o", str(tmp_path / "out")]
    assert main(arguments) == 0
    warning = f"burg-drake: warning: {scene_file}: 'mug' is off the board: "
    assert capsys.readouterr().err.startswith(warning)
