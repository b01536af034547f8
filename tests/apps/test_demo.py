"""`demo`: a run, its best grasp in 3D, and the list of its files."""

from __future__ import annotations

import csv
import re
import webbrowser
from pathlib import Path

import pytest

from burg_drake.apps import main
from burg_drake.apps.commands import demo
from burg_drake.core import builtin_names
from tests.apps.conftest import TWO


def test_what_it_runs_is_there() -> None:
    assert demo.DEMO_SCENE in builtin_names("scenes")


@pytest.mark.thorough
def test_the_demo(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "two.yaml").write_text(TWO)
    monkeypatch.setattr(demo, "DEMO_SCENE", str(tmp_path / "two.yaml"))
    monkeypatch.chdir(tmp_path)
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    assert main(["demo", "-n", "2", "--workers", "1", "--quiet"]) == 0
    told = capsys.readouterr().out
    folder = tmp_path / "runs" / "demo_2"
    for name in ("report.html", "replay.html", "results.csv"):
        assert f"runs/demo_2/{name}  " in told
        assert (folder / name).stat().st_size > 0
    assert "\nall " in told and "as recorded" in told and opened == []
    with (folder / "results.csv").open(newline="") as table:
        lifted = [row for row in csv.DictReader(table) if row["outcome"] == "lifted"]
    (listed,) = re.findall(r"^best    ((?:.*\n {8})*.*)\nbest: ", told, re.MULTILINE)
    best = [next(row for row in lifted if row["id"] == id) for id in listed.split()]
    assert best and [row["object"] for row in best] == list(
        dict.fromkeys(r["object"] for r in lifted)
    )
    assert "burg-drake replay runs/demo_2 --grasp ID\n" in told
    journal = (folder / "journal.jsonl").read_bytes()
    assert main(["demo", "-n", "2", "--workers", "1", "--quiet", "--open"]) == 0
    assert (folder / "journal.jsonl").read_bytes() == journal  # nothing was evaluated again
    assert opened == [(folder / name).as_uri() for name in ("report.html", "replay.html")]
