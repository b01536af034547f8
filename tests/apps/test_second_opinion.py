"""`evaluate --rejudge contested`: a second engine settles what is contested, by real trials."""

from __future__ import annotations

from pathlib import Path

import pytest

from burg_drake.apps.cli import main
from burg_drake.core.grasps import verdict
from burg_drake.core.grasps.grasp_set import GraspSet
from burg_drake.evaluation.store.run_folder import load_run

from .conftest import X_OG

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def command(tmp_path: Path) -> list[str]:
    """Judges a grasp that lifts the box, one that collides with it, and one in thin air."""
    GraspSet.create(X_OG, object="box").save(tmp_path / "grasps.npz")
    words = ["evaluate", "tabletop_six", "-o", str(tmp_path / "run"), "--mode", "hand"]
    return [*words, "--grasps", str(tmp_path / "grasps.npz"), "--quiet", "--workers", "1"]


def test_all_in_one_command(
    command: list[str], tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(verdict, "CONTESTED", 1.1)  # every executed verdict is
    assert main([*command, "--rejudge", "contested", "--engine", "reference"]) == 0
    assert "settled 2 contested grasps by reference; changed 0" in capsys.readouterr().out
    run = load_run(tmp_path / "run")
    assert run.document.engine.name == "standard"
    assert run.results["outcome"].tolist() == ["lifted", "collision_target", "no_contact"]
    assert run.results["engine"].tolist() == ["reference", "standard", "reference"]
    # a row that a second engine gave is replayed with that engine
    lifted = str(run.results["id"][0])
    page = str(tmp_path / "replay.html")
    assert main(["replay", str(run.path), "--grasp", lifted, "--html", page]) == 0
    assert "as recorded" in capsys.readouterr().out
    # and the same command has nothing left to do
    assert main([*command, "--rejudge", "contested", "--engine", "reference"]) == 0
    assert load_run(run.path).verdicts == run.verdicts


def test_where_nothing_is_contested(
    command: list[str], capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(verdict, "CONTESTED", 0.0)
    assert main([*command, "--rejudge", "contested", "--engine", "reference"]) == 0
    assert "no verdict is contested" in capsys.readouterr().out


def test_nothing_is_judged_where_the_request_contradicts_itself(
    command: list[str], tmp_path: Path, capsys: Capture
) -> None:
    assert main([*command, "--rejudge", "contested"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "engine 'standard' is the one that has judged all grasps" in line
    assert "give one of reference, mujoco" in line
    assert main([*command, "--rejudge", "contested", "--engine", "screening"]) == 2
    assert "'screening' takes longer steps than the one" in capsys.readouterr().err
    assert (
        main([*command, "--rejudge", "contested", "--engine", "reference", "--shard", "1/2"]) == 2
    )
    assert "merge the shards first" in capsys.readouterr().err
    arm = ["--rejudge", "contested", "--engine", "mujoco", "--mode", "arm"]
    assert main([*command, *arm]) == 2
    assert "mode arm is simulated by Drake" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
    many = [command[0], "tabletop_six", "tabletop_close", *command[2:4], "--rejudge", "contested"]
    assert main([*many, "--engine", "reference"]) == 2
    assert "--rejudge settles the run of one scene" in capsys.readouterr().err
