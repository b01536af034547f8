"""`--engine mujoco-gpu`, without a card: evaluated with `--device cpu`, replayed, and refused."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.core import GraspSet
from burg_drake.evaluation import Run, load_run, run_notes

warp = pytest.importorskip("warp")

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def arguments(run: Run, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Asks for the grasps of the usual run."""
    grasps = str(tmp_path_factory.mktemp("grasps") / "grasps.npz")
    X_OG = np.stack([candidate.X_OG for candidate in run.candidates])
    GraspSet.create(X_OG, object="box", width=0.06).save(grasps)
    scene = str(run.path.with_suffix(".yaml"))
    return ["evaluate", scene, "--grasps", grasps, "--mode", "hand", "--workers", "1", "--quiet"]


@pytest.fixture(scope="module")
def gpu_run(arguments: list[str], tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("gpu") / "run"
    given = [*arguments, "-o", str(folder), "--engine", "mujoco-gpu", "--device", "cpu"]
    assert main(given) == 0
    return load_run(folder)


def test_verdicts_are_those_of_the_engine_on_the_cpu(
    gpu_run: Run, arguments: list[str], tmp_path: Path
) -> None:
    assert main([*arguments, "-o", str(tmp_path / "run"), "--engine", "mujoco"]) == 0
    single = load_run(tmp_path / "run")
    assert gpu_run.results["id"].tolist() == single.results["id"].tolist()
    assert gpu_run.results["outcome"].tolist() == single.results["outcome"].tolist()
    assert "lifted" in gpu_run.results["outcome"].tolist()
    assert set(gpu_run.results["engine"].tolist()) == {"mujoco-gpu"}


def test_device_and_versions_are_recorded(gpu_run: Run) -> None:
    versions = gpu_run.document.versions
    assert (versions["device"], versions["warp"]) == ("cpu", warp.__version__)
    assert re.search(r"device\W+.{0,40}cpu", gpu_run.report_path.read_text(), re.DOTALL)


def test_a_run_that_is_complete_returns_at_once(gpu_run: Run, arguments: list[str]) -> None:
    before = gpu_run.table_path.stat().st_mtime_ns
    """Without a card, too."""
    given = [*arguments, "-o", str(gpu_run.path), "--engine", "mujoco-gpu"]
    assert main(given) == 0
    assert gpu_run.table_path.stat().st_mtime_ns == before


def test_a_run_that_goes_on_with_another_device_says_so(
    gpu_run: Run, arguments: list[str], tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    shutil.copytree(gpu_run.path, folder)
    document, journal = folder / "run.yaml", folder / "journal.jsonl"
    document.write_text(document.read_text().replace("device: cpu", "device: NVIDIA H100"))
    journal.write_text("".join(journal.read_text().splitlines(keepends=True)[:-1]))
    begun = load_run(folder)
    assert len(begun.left) == 1 and not any("devices" in note for note in run_notes(begun))
    given = [*arguments, "-o", str(folder), "--engine", "mujoco-gpu", "--device", "cpu"]
    assert main(given) == 0
    run = load_run(folder)
    assert [session.device for session in run.document.stretches] == ["NVIDIA H100", "cpu"]
    assert run.results["outcome"].tolist() == gpu_run.results["outcome"].tolist()
    note = "judged on 2 devices, whose results may differ by rounding: NVIDIA H100; cpu"
    assert any(note in one for one in run_notes(run))
    assert note in re.sub(r"<[^>]*>", "", run.report_path.read_text())


def test_replayed_on_the_cpu_which_is_said(gpu_run: Run, tmp_path: Path, capsys: Capture) -> None:
    assert main(["replay", str(gpu_run.path), "--best", "--html", str(tmp_path / "x.html")]) == 0
    out = capsys.readouterr().out
    assert "simulated by engine mujoco, on the CPU" in out and "as recorded" in out


def test_contested_grasps_go_to_another_physics(
    gpu_run: Run, arguments: list[str], capsys: Capture
) -> None:
    """Not to the same one, on the CPU."""
    given = [*arguments, "-o", str(gpu_run.path), "--rejudge", "contested", "--engine", "mujoco"]
    assert main(given) == 2
    err = capsys.readouterr().err
    assert "'mujoco' has the physics of the one" in err
    assert "give one of reference, standard, screening" in err


def test_without_a_card_one_line_says_so(
    arguments: list[str], tmp_path: Path, capsys: Capture
) -> None:
    if warp.is_cuda_available():
        pytest.skip("there is a card")
    given = [*arguments, "-o", str(tmp_path / "run"), "--engine", "mujoco-gpu"]
    assert main(given) == 2
    err = capsys.readouterr().err
    assert "needs an NVIDIA card" in err and "(--device)" in err
    assert not (tmp_path / "run").exists()


def test_a_device_is_for_that_engine(arguments: list[str], tmp_path: Path, capsys: Capture) -> None:
    assert main([*arguments, "-o", str(tmp_path / "run"), "--device", "cpu"]) == 2
    assert "has no effect with engine standard" in capsys.readouterr().err


def test_the_arm_is_drakes(arguments: list[str], tmp_path: Path, capsys: Capture) -> None:
    given = ["evaluate", "tabletop_six", "--mode", "arm", "-o", str(tmp_path / "run")]
    assert main([*given, "--engine", "mujoco-gpu", "--device", "cpu"]) == 2
    assert "mode arm needs an engine of Drake" in capsys.readouterr().err
