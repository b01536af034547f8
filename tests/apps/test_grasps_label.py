"""`grasps label`: what it writes and prints, given grasps, replay, and what it refuses."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.core import GraspSet, verdict
from burg_drake.evaluation import load_run, results_table
from burg_drake.formats import LABELLED_BY, read_grasp_file, success_labels

Capture = pytest.CaptureFixture[str]
QUICK = ["--workers", "1", "--quiet"]


def label(*more: str) -> int:
    return main(["grasps", "label", "household", "--only", "box", *more, *QUICK])


def test_writes_labels_and_prints_them_by_object(tmp_path: Path, capsys: Capture) -> None:
    arguments = ["-n", "3", "--engine", "screening", "--to", "acronym", "-o", str(tmp_path)]
    assert label(*arguments) == 0
    out = capsys.readouterr().out
    labels = success_labels(read_grasp_file(tmp_path / "box.h5", "acronym").grasps)
    assert len(labels) == 3
    assert f"wrote 3 labelled grasps to {tmp_path / 'box.h5'} as acronym (ACRONYM)" in out
    (row,) = (line.split() for line in out.splitlines() if line.startswith("box "))
    assert row[:3] == ["box", "3", f"{int(labels.sum())}"]
    assert out.count("has no place for") == 1


def test_contested_labels_are_counted_and_settled(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(results_table, "CONTESTED_CONFIDENCE", 1.1)  # every executed one is
    monkeypatch.setattr(verdict, "CONTESTED_CONFIDENCE", 1.1)
    arguments = ["-n", "2", "-o", str(tmp_path)]
    assert label(*arguments, "--engine", "screening") == 0
    advice = "contested: 2 labels (box 2); settle them by the same command with --rejudge contested"
    assert advice in capsys.readouterr().out
    assert label(*arguments, "--rejudge", "contested", "--engine", "standard") == 0
    out = capsys.readouterr().out
    assert "settled 2 contested grasps by standard; changed" in out and "contested: " not in out
    grasps = read_grasp_file(tmp_path / "box.h5").grasps
    assert set(grasps.column("judged_again").tolist()) == {"standard"}
    assert label(*arguments, "--rejudge", "contested", "--engine", "screening") == 2
    assert "is the one that has judged all grasps" in capsys.readouterr().err


@pytest.fixture(scope="module")
def shaken(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("shaken")
    arguments = ["--protocol", "shake", "--engine", "screening", "-n", "2", "-o", str(folder)]
    assert label(*arguments) == 0
    return folder


def test_shaken_grasps_are_replayed_and_can_be_made_again(shaken: Path, capsys: Capture) -> None:
    run = load_run(shaken / "runs" / "box")
    assert main(["replay", str(run.path), "--grasp", run.candidates[0].id, "--no-wait"]) == 0
    out = capsys.readouterr().out
    assert run.document.protocol == "shake"
    by = read_grasp_file(shaken / "box.h5").grasps.provenance[LABELLED_BY]
    assert by["trial"]["shake_periods"] == 2
    assert not {"lift_height", "lift_time", "hold_time"} & set(by["trial"])
    assert "shaken 2 times along the approach" in out
    words = re.sub(r"<[^>]+>", " ", (run.path / "report.html").read_text()).split()
    assert words[words.index("--protocol") + 1] == "shake"
    assert "--tilt-limit" not in words
    assert "mode hand, protocol shake, engine screening" in " ".join(words)


def test_evaluate_shakes_in_the_same_way(shaken: Path, capsys: Capture) -> None:
    """It goes on with the run of the labels, so that it has the same settings."""
    run, scene = shaken / "runs" / "box", shaken / "scenes" / "box.yaml"
    options = ["--mode", "hand", "--protocol", "shake", "--engine", "screening", "-n", "2"]
    command = ["evaluate", str(scene), *options, "-o", str(run), *QUICK]
    assert main(command) == 0
    assert "will fall" not in capsys.readouterr().err  # as there is no gravity
    assert main(["evaluate", "tabletop_six", *command[2:-5], "-o", str(run / "six")]) == 2
    assert "grasps label LIBRARY --protocol shake" in capsys.readouterr().err
    assert main([*command, "--rejudge", "contested"]) == 2
    assert "have no confidence, so that none is contested" in capsys.readouterr().err
    assert load_run(run).document.trial["tilt_limit"] >= np.pi


def test_labels_of_others_are_compared(shaken: Path, tmp_path: Path, capsys: Capture) -> None:
    grasps = read_grasp_file(shaken / "box.h5").grasps
    theirs = str(tmp_path / "theirs.h5")
    GraspSet.create(grasps.X_OG, object="theirs", score=np.array([0.0, 1.0])).save(theirs)
    more = ["--rename", "box", "--protocol", "shake", "--engine", "screening"]
    assert label("--grasps", theirs, *more, "-o", str(tmp_path / "again")) == 0
    assert "1 of 2" in capsys.readouterr().out


def test_grasps_are_not_replaced_by_their_labels(
    shaken: Path, tmp_path: Path, capsys: Capture
) -> None:
    """Also not if they are labels of an earlier call."""
    before = (shaken / "box.h5").read_bytes()
    assert label("--grasps", str(shaken / "box.h5"), "-o", str(shaken)) == 2
    assert "labels would replace" in capsys.readouterr().err
    assert (shaken / "box.h5").read_bytes() == before


def test_what_has_no_effect_is_refused(tmp_path: Path, capsys: Capture) -> None:
    for more in (["--tilt-limit", "10"], ["--approach-angle", "30"]):
        assert label("--protocol", "shake", *more, "-o", str(tmp_path / "out")) == 2
        assert f"{more[0]} has no effect with --protocol shake" in capsys.readouterr().err
    assert label("--protocol", "shake", "--rejudge", "contested", "-o", str(tmp_path / "out")) == 2
    assert "have no confidence, so that none is contested" in capsys.readouterr().err
    assert label("--rename", "box", "-o", str(tmp_path / "out")) == 2
    assert "--rename is for grasp files; add --grasps FILE" in capsys.readouterr().err
    assert label("--to", "graspnet", "-o", str(tmp_path / "out")) == 2
    assert "in the camera frame" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
