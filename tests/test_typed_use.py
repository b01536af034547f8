"""Type checkers know the public names: they accept a right program, and report each wrong line."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PROGRAMS = Path(__file__).parent / "typed_use"
RIGHT, WRONG = PROGRAMS / "right.py", PROGRAMS / "wrong.py"

Report = tuple[str, int, str, str]
"""File, line from 1, `error` or what else it is, message."""


@cache
def mypy() -> list[Report]:
    """What mypy reports, with the settings and the cache of `make lint`."""
    command = [sys.executable, "-m", "mypy", "--no-error-summary", RIGHT, WRONG]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    lines = re.findall(r"^(.+?):(\d+): (\w+): (.*)$", done.stdout, re.MULTILINE)
    return [(Path(file).name, int(line), kind, text) for file, line, kind, text in lines]


@cache
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


CHECKERS = pytest.mark.parametrize("checker", [mypy, pyright], ids=["mypy", "pyright"])


@CHECKERS
def test_a_right_program_is_accepted(checker) -> None:
    reports = [report for report in checker() if report[0] == RIGHT.name]
    assert [report for report in reports if report[2] == "error"] == []


@CHECKERS
def test_types_are_known(checker) -> None:
    revealed = [text for file, _, _, text in checker() if file == RIGHT.name]
    types = [
        re.findall('"(.*)"', text)[-1] for text in revealed if text.startswith(("Rev", "Type"))
    ]
    assert len(types) == 3
    assert all(not re.match(r"(Any|Unknown)\b", one) for one in types)
    for one, name in zip(types, ("Run", "HandTrial", "GraspSet"), strict=True):
        assert name in one


@CHECKERS
def test_each_wrong_line_is_reported(checker) -> None:
    lines = WRONG.read_text("utf-8").splitlines()
    wrong = {number for number, line in enumerate(lines, 1) if "# wrong" in line}
    reports = {
        line: text for file, line, kind, text in checker() if (file, kind) == (WRONG.name, "error")
    }
    assert set(reports) == wrong, reports
