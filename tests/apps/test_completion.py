"""Shell completion: the line in the environment, the answer in a file."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from burg_drake.apps import main
from burg_drake.core import data_root

HEAVY = ("numpy", "yaml", "rich", "pydrake", "trimesh")


def completed(line: str, folder: Path) -> tuple[set[str], str]:
    """The words that complete a line, and which modules the process has imported."""
    answer = folder / ".answer"
    environment = os.environ | {
        "_ARGCOMPLETE": "1",
        "_ARGCOMPLETE_IFS": "\n",
        "_ARGCOMPLETE_SHELL": "bash",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(answer),
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
        "COMP_TYPE": "9",
    }
    code = "from burg_drake.apps.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-X", "importtime", "-c", code],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return {word.rstrip() for word in answer.read_text().split("\n") if word}, done.stderr


def built_in(pattern: str) -> set[str]:
    return {path.stem for path in data_root().glob(pattern)}


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("burg-drake eval", {"evaluate"}),
        ("burg-drake grasps s", {"sample", "score", "show", "stats"}),
        ("burg-drake evaluate x --slip", {"--slip-limit-mm"}),
        ("burg-drake evaluate x --mode ", {"hand", "reach", "arm"}),
        ("burg-drake completion ", {"bash", "zsh", "fish"}),
        ("burg-drake evaluate ta", built_in("scenes/*.yaml")),
        ("burg-drake scene show x --station panda_s", built_in("stations/panda_s*.yaml")),
        ("burg-drake hand check w", built_in("models/hands/w*.yaml")),
        ("burg-drake library list hou", {"household"}),
        ("burg-drake evaluate my", {"my_scene.yaml", "my_folder/"}),
        ("burg-drake evaluate 'my_s", {"my_scene.yaml"}),
    ],
)
def test_what_completes_a_line(line: str, expected: set[str], tmp_path: Path) -> None:
    (tmp_path / "my_scene.yaml").touch()
    (tmp_path / "my_folder").mkdir()
    words, imported = completed(line, tmp_path)
    assert words == expected != set()
    assert [name for name in HEAVY if f" {name}\n" in imported] == []


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_is_one_of_the_shell(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert "burg-drake" in script
    if program := shutil.which(shell):
        subprocess.run([program, "-n"], input=script, text=True, check=True)
