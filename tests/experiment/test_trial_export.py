"""Motions of trials: a file, named by number, for each trial that the arm can execute."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.core import InvalidInputError, grasp_from_axes
from burg_drake.experiment import export_trials, plan_trials, save_trials
from burg_drake.motion import load_plan
from burg_drake.station import instance_pose
from tests.experiment.known_runs import ended, make_run, make_scene

ABOVE = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.0, 0.0, 0.18))
"""Across the narrow side of the box, from above."""
BELOW = grasp_from_axes((1, 0, 0), (0, 0, 1), (0.0, 0.0, 0.02))
"""Through the table."""


def test_motions_go_by_numbers_and_are_kept(
    judged_here: None,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = make_scene(tmp_path)
    verdicts = {"box": [ended("lifted"), ended("slipped")]}
    run = make_run(tmp_path / "run", scene, verdicts, poses={"box": np.stack([ABOVE, BELOW])})
    path, out = tmp_path / "trials.yaml", tmp_path / "plans"
    sheet = plan_trials(run, out=path)
    good, bad = (next(t for t in sheet.trials if t.grasp == run.candidates.id[k]) for k in range(2))
    save_trials(replace(sheet, trials=(*sheet.trials, replace(good, number=3))), path)
    words = ["trials", "export", str(path), "-o", str(out), "--workers", "1", "--quiet"]
    assert main(words) == 0
    printed = capsys.readouterr().out
    assert "2 of 3 motions are in" in printed and "collision_table" in printed
    file = out / f"{good.number:03d}_{good.grasp}.json"
    plan = load_plan(file, scene=run.scene(), station=run.station())
    assert plan.origin is not None and plan.origin.instance == "box"
    X_WO = instance_pose(scene, run.station(), "box")
    np.testing.assert_allclose(plan.origin.X_WG, X_WO @ ABOVE, atol=1e-9)
    assert (out / f"003_{good.grasp}.json").read_bytes() == file.read_bytes()
    with (out / "index.csv").open() as stream:
        rows = {int(row["number"]): row for row in csv.DictReader(stream)}
    assert rows[good.number]["file"] == file.name
    assert float(rows[good.number]["duration"]) == round(plan.duration, 3)
    assert "simulated" not in rows[good.number]  # who carries them out reads it
    assert (rows[bad.number]["file"], rows[bad.number]["answer"]) == ("", "collision_table")

    stamp = file.stat().st_mtime_ns
    monkeypatch.setattr("burg_drake.evaluation.feasibility.judge_all", _nothing_left)
    assert main(words) == 0 and file.stat().st_mtime_ns == stamp
    save_trials(replace(sheet, trials=(good,)), path)
    with pytest.raises(InvalidInputError, match="has plans of another evaluation"):
        export_trials(path, out)
    with pytest.raises(InvalidInputError, match="it has plans in it"):
        export_trials(path, tmp_path)


def _nothing_left(candidates: list[object], *_: object, **__: object) -> object:
    assert not candidates
    return (pair for pair in ())
