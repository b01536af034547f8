"""`evaluate --rejudge contested`: a second engine settles what is contested, by real trials."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.core import GraspSet, InvalidInputError, verdict
from burg_drake.evaluation import (
    Campaign,
    Journal,
    judge_again,
    load_campaign,
    load_run,
    results_table,
    settle_verdict,
)

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
    monkeypatch.setattr(verdict, "CONTESTED_CONFIDENCE", 1.1)  # every executed verdict is
    monkeypatch.setattr(results_table, "CONTESTED_CONFIDENCE", 1.1)
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
    monkeypatch.setattr(verdict, "CONTESTED_CONFIDENCE", 0.0)
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
    assert "mode arm needs an engine of Drake" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def of_scenes(command: list[str]) -> list[str]:
    """The command for two scenes."""
    return [command[0], "tabletop_six", "tabletop_close", *command[2:]]


@pytest.fixture(scope="module")
def judged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run over two scenes."""
    pytest.importorskip("pyarrow")
    folder = tmp_path_factory.mktemp("scenes")
    GraspSet.create(X_OG, object="box").save(folder / "grasps.npz")
    words = ["evaluate", "-", "-o", str(folder / "run"), "--mode", "hand"]
    words += ["--grasps", str(folder / "grasps.npz"), "--quiet", "--workers", "1"]
    assert main(of_scenes(words)) == 0
    return folder / "run"


@pytest.fixture
def many(judged: Path, tmp_path: Path) -> Campaign:
    """A copy of it."""
    return load_campaign(shutil.copytree(judged, tmp_path / "run"))


@pytest.mark.thorough
def test_all_scenes_of_a_run_are_settled(
    command: list[str], many: Campaign, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(verdict, "CONTESTED_CONFIDENCE", 1.1)
    monkeypatch.setattr(results_table, "CONTESTED_CONFIDENCE", 1.1)
    names = ("outcome", "judged_again", "engine", "run")
    before = many.columns(names)
    executed = before["outcome"] != "collision_target"
    assert executed.sum() == 4 and not (before["judged_again"] != "").any()
    again = [*of_scenes(command), "--rejudge", "contested", "--engine", "reference"]
    assert main(again) == 0
    assert "settled 4 contested grasps by reference" in capsys.readouterr().out
    campaign = load_campaign(many.path)
    after = campaign.columns(names)
    assert (after["judged_again"] == np.where(executed, "reference", "")).all()
    assert (after["engine"] == np.where(executed, "reference", "standard")).all()
    assert (after["run"] == before["run"]).all() and len(after["run"]) == len(before["run"])
    for run in campaign.runs:  # as a run of that scene alone would tell
        assert run.contested == [] and (run.results["judged_again"] != "").sum() == 2
        rows = (run.path / "results.csv").read_text()
        assert rows.count("reference") >= 2
    assert (campaign.path / "report.html").stat().st_mtime_ns >= max(
        (run.path / "results.csv").stat().st_mtime_ns for run in campaign.runs
    )
    sessions = len(campaign.document.stretches)
    # the same commands have nothing left to do
    for words in (again, of_scenes(command)):
        assert main(words) == 0
        assert len(load_campaign(campaign.path).document.stretches) == sessions


def test_a_scene_that_was_left_half_way_is_finished(
    many: Campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As after an interruption: the journal has the new verdict, the table has not."""
    monkeypatch.setattr(verdict, "CONTESTED_CONFIDENCE", 0.0)
    monkeypatch.setattr(results_table, "CONTESTED_CONFIDENCE", 0.0)
    run = many.runs[0]
    id = run.candidates.id[0]
    with Journal(run.path / "journal.jsonl") as journal:
        journal.append(id, settle_verdict(run.verdicts[id], run.verdicts[id], "reference"))
    campaign = judge_again(str(many.path), workers=1, progress=False)
    assert isinstance(campaign, Campaign)
    assert "reference" in (run.path / "results.csv").read_text()
    again = campaign.columns(["judged_again"])["judged_again"].tolist()
    assert again.count("reference") == 1 and len(again) == 6
    state = campaign.states[campaign.names[0]]
    assert state.size == (run.path / "journal.jsonl").stat().st_size


def test_what_contradicts_itself_is_refused_of_many_scenes(
    command: list[str], many: Campaign, capsys: Capture
) -> None:
    words = [*of_scenes(command), "--rejudge", "contested", "--engine"]
    assert main([*words, "standard"]) == 2
    assert "'standard' is the one that has judged all" in capsys.readouterr().err
    assert main([*words, "reference", "--shard", "1/2"]) == 2
    assert "merge the shards first" in capsys.readouterr().err
    (many.path / "scenes.jsonl").unlink()
    with pytest.raises(InvalidInputError, match=r"is not complete \(.*tabletop_six"):
        judge_again(load_campaign(many.path))
