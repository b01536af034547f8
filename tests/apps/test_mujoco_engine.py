"""`--engine mujoco`: evaluated, replayed, tested, and refused where MuJoCo cannot be asked."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.core import GraspSet, MissingDependencyError
from burg_drake.evaluation import EvaluationSettings, Run, RunRequest, load_run
from burg_drake.station import load_station

pytest.importorskip("mujoco")

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def mujoco_run(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The grasps of the usual run, with MuJoCo."""
    folder = tmp_path_factory.mktemp("mujoco")
    X_OG = np.stack([candidate.X_OG for candidate in run.candidates])
    GraspSet.create(X_OG, object="box", width=0.06).save(folder / "grasps.npz")
    arguments = ["evaluate", str(run.path.with_suffix(".yaml")), "-o", str(folder / "run")]
    arguments += ["--grasps", str(folder / "grasps.npz"), "--mode", "hand", "--engine", "mujoco"]
    assert main([*arguments, "--workers", "1", "--quiet"]) == 0
    return load_run(folder / "run")


def test_outcomes_and_what_gave_them(run: Run, mujoco_run: Run) -> None:
    assert mujoco_run.results["outcome"].tolist() == run.results["outcome"].tolist()
    assert set(mujoco_run.results["engine"].tolist()) == {"mujoco"}
    assert mujoco_run.document.versions["mujoco"] == version("mujoco")
    assert "mujoco" not in run.document.versions


def test_replayed_to_the_bit_and_shown(mujoco_run: Run, tmp_path: Path, capsys: Capture) -> None:
    page = tmp_path / "replay.html"
    assert main(["replay", str(mujoco_run.path), "--best", "--html", str(page)]) == 0
    assert "as recorded" in capsys.readouterr().out
    still = tmp_path / "still.html"
    (id,) = (
        i
        for i, o in zip(*(mujoco_run.results[c] for c in ("id", "outcome")), strict=True)
        if o == "collision_target"
    )
    assert main(["replay", str(mujoco_run.path), "--grasp", id, "--html", str(still)]) == 0
    assert page.stat().st_size > still.stat().st_size + 10_000  # the motion


def test_robustness_as_far_as_it_needs_no_drake(
    mujoco_run: Run, tmp_path: Path, capsys: Capture
) -> None:
    folder = tmp_path / "run"
    shutil.copytree(mujoco_run.path, folder)
    options = ["robustness", str(folder), "--workers", "1", "--quiet", "--repeats", "2"]
    assert main(options) == 2
    message = "tug and shake need Drake, but "
    err = capsys.readouterr().err
    assert message in err and "was judged by engine mujoco; give the tests friction,noise" in err
    assert main([*options, "--tests", "friction,noise"]) == 0
    assert "of 2" in capsys.readouterr().out


def test_the_arm_is_drakes(tmp_path: Path, capsys: Capture) -> None:
    arguments = ["evaluate", "tabletop_six", "-o", str(tmp_path / "run"), "--engine", "mujoco"]
    assert main([*arguments, "--mode", "arm"]) == 2
    message = "mode arm needs an engine of Drake (reference, standard, screening)"
    assert message in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_without_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util,
        "find_spec",
        lambda name, *rest: None if name == "mujoco" else find(name, *rest),
    )
    settings = EvaluationSettings(engine="mujoco", mode="hand")
    with pytest.raises(MissingDependencyError, match=r"pip install 'burg-drake\[mujoco\]'"):
        RunRequest.of(load_station("panda_tabletop"), settings)


def test_mujoco_is_loaded_only_where_it_is_asked_for() -> None:
    code = "import sys, burg_drake; burg_drake.HandTrial; sys.exit('mujoco' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
