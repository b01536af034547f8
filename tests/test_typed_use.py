"""Type checkers know the public names: they accept a right program, and report each wrong line."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PROGRAMS = Path(__file__).parent / "typed_use"
RIGHT, WRONG = PROGRAMS / "right.py", PROGRAMS / "wrong.py"

Report = tuple[str, int, str, str]
"""File, line from 1, `error` or what else it is, message."""


def mypy() -> list[Report]:
    """What mypy reports, with the settings and the cache of `make lint`."""
    command = [sys.executable, "-m", "mypy", "--no-error-summary", RIGHT, WRONG]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    lines = re.findall(r"^(.+?):(\d+): (\w+): (.*)$", done.stdout, re.MULTILINE)
    return [(Path(file).name, int(line), kind, text) for file, line, kind, text in lines]


def pyright() -> list[Report]:
    """What pyright reports of the package as this Python imports it."""
    command = [sys.executable, "-m", "pyright", "--pythonpath", sys.executable]
    done = subprocess.run(
        [*command, "--outputjson", RIGHT, WRONG], cwd=PROGRAMS, capture_output=True, text=True
    )
    assert done.returncode in (0, 1), done.stdout + done.stderr
    return [
        (Path(one["file"]).name, one["range"]["start"]["line"] + 1, one["severity"], one["message"])
        for one in json.loads(done.stdout)["generalDiagnostics"]
    ]


@pytest.mark.parametrize(
    "checker",
    [
        pytest.param(mypy, id="mypy", marks=pytest.mark.thorough),
        pytest.param(pyright, id="pyright"),
    ],
)
def test_what_is_right_is_accepted_and_what_is_wrong_reported(checker) -> None:
    reports = checker()
    assert [report for report in reports if (report[0], report[2]) == (RIGHT.name, "error")] == []

    revealed = [text for file, _, _, text in reports if file == RIGHT.name]
    types = [
        re.findall('"(.*)"', text)[-1] for text in revealed if text.startswith(("Rev", "Type"))
    ]
    assert len(types) == 3
    assert all(not re.match(r"(Any|Unknown)\b", one) for one in types)
    for one, name in zip(types, ("Run", "HandTrial", "GraspSet"), strict=True):
        assert name in one

    lines = WRONG.read_text("utf-8").splitlines()
    wrong = {number for number, line in enumerate(lines, 1) if "# wrong" in line}
    found = {
        line: text for file, line, kind, text in reports if (file, kind) == (WRONG.name, "error")
    }
    assert set(found) == wrong, found
