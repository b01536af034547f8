"""`--engine mujoco-gpu`, without a card: evaluated with `--device cpu`, replayed, and refused."""

from __future__ import annotations

import html
import importlib.metadata
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.core import GraspSet, Outcome, Stage, grasp_from_axes
from burg_drake.evaluation import EvaluationSettings, Run, evaluate, load_run, run_notes

warp = pytest.importorskip("warp")

Capture = pytest.CaptureFixture[str]
AGAIN = "judged again by engine mujoco-gpu on Warp's CPU device"


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


def pretend_a_card(run: Path) -> None:
    """Changes the document of a run as if a card had judged it."""
    document, text = run / "run.yaml", (run / "run.yaml").read_text()
    for before in ("device: cpu", "cpu: 2"):
        assert before in text
        text = text.replace(before, before.replace("cpu", "NVIDIA H100"))
    document.write_text(text)


def test_grasps_that_are_left_to_the_cpu_are_counted(
    gpu_run: Run, arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As if trials in which nothing is touched needed it; the other grasp collides."""
    (session,) = gpu_run.document.stretches
    assert session.executed == {"cpu": 2}
    assert not any("CPU" in note for note in run_notes(gpu_run))
    no_contact = 7
    monkeypatch.setattr("burg_drake.simulation.batch.batch_trial.NEEDS_CPU", (no_contact,))
    given = [*arguments, "-o", str(tmp_path / "run"), "--engine", "mujoco-gpu", "--device", "cpu"]
    assert main(given) == 0
    run = load_run(tmp_path / "run")
    (session,) = run.document.stretches
    assert session.executed == {"cpu": 1, "one by one on the CPU": 1}
    assert run.results["outcome"].tolist() == gpu_run.results["outcome"].tolist()
    note = "1 of 2 executed grasps one by one on the CPU"
    assert f"{note}; the others in parallel" in run_notes(run)
    page = re.sub(r"<[^>]*>", "", run.report_path.read_text())
    assert f"cpu; {note}" in page and f"on cpu; {note}" in page


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
    pretend_a_card(folder)
    journal = folder / "journal.jsonl"
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


def replay(results: Path, page: Path, capsys: Capture) -> tuple[int, list[str]]:
    """What a replay of the grasp that lifts returns and prints."""
    ended = main(["replay", str(results), "--best", "--html", str(page)])
    return ended, capsys.readouterr().out.splitlines()


def test_replayed_by_the_same_engine_on_the_same_device(
    gpu_run: Run, tmp_path: Path, capsys: Capture
) -> None:
    page = tmp_path / "x.html"
    for results in (gpu_run.path, gpu_run.table_path):
        ended, lines = replay(results, page, capsys)
        assert ended == 0 and {AGAIN, "as recorded"} <= set(lines)
    assert AGAIN in html.unescape(page.read_text())


def test_the_last_bits_count_then(gpu_run: Run, tmp_path: Path, capsys: Capture) -> None:
    """The pads press a millionth harder in this record."""
    shutil.copytree(gpu_run.path, tmp_path / "run")
    journal = tmp_path / "run" / "journal.jsonl"
    force = re.compile(r'"pad_force":([0-9.]+)')
    changed = force.sub(lambda m: f'"pad_force":{float(m[1]) * 1.000001}', journal.read_text())
    journal.write_text(changed)
    ended, lines = replay(tmp_path / "run", tmp_path / "x.html", capsys)
    assert ended == 1 and {AGAIN, "differs from what was recorded"} <= set(lines)


def test_replayed_on_the_cpu_if_there_is_no_card(
    gpu_run: Run, tmp_path: Path, capsys: Capture
) -> None:
    if warp.is_cuda_available():
        pytest.skip("there is a card")
    shutil.copytree(gpu_run.path, tmp_path / "run")
    pretend_a_card(tmp_path / "run")
    ended, lines = replay(tmp_path / "run", tmp_path / "x.html", capsys)
    assert ended == 0 and "judged again by engine mujoco on the CPU" in lines
    assert "as recorded, but for what engine mujoco on the CPU rounds in another way" in lines


FAR = """\
version: 1
name: far
library: household
board: {size: [1.3, 0.84]}
instances:
- {name: near, object: box, X_SO: {translation: [0.3, 0.2, 0.0]}}
- {name: far, object: box, X_SO: {translation: [0.95, 0.6, 0.0]}}
"""
"""Two boxes, the second out of the arm's reach."""


def test_in_mode_reach_it_executes_what_the_arm_can_reach(tmp_path: Path) -> None:
    """With the verdicts of mode hand, and those of the engine on the CPU."""
    (tmp_path / "far.yaml").write_text(FAR)
    above = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.0, 0.0, 0.18))
    side = grasp_from_axes((1, 0, 0), (0, 1, 0), (0.0, -0.065, 0.16))
    grasps = GraspSet.create(np.stack([above, side]), object="box", width=0.06)

    def judged(mode: str, engine: str, device: str | None) -> Run:
        return evaluate(
            tmp_path / "far.yaml",
            "panda_tabletop",
            tmp_path / f"{mode}_{engine}",
            grasps={"near": grasps, "far": grasps},
            settings=EvaluationSettings(mode=mode, engine=engine, device=device),
            workers=1,
            progress=False,
        )

    reach = judged("reach", "mujoco-gpu", "cpu").verdicts
    hand = judged("hand", "mujoco-gpu", "cpu").verdicts
    single = judged("reach", "mujoco", None).verdicts
    executed = {id for id, verdict in reach.items() if verdict.stage is Stage.EXECUTED}
    assert {id.partition("-")[0] for id in executed} == {"near"}
    assert {reach[id].outcome for id in reach.keys() - executed} <= {
        Outcome.NO_IK,
        Outcome.ARM_COLLISION,
    }
    for id, verdict in hand.items():
        assert verdict.stage is Stage.EXECUTED
        assert reach[id].outcome is single[id].outcome
        if id in executed:  # to the bit
            arm = {"arm_clearance", "joint_excess"}
            margins = {n: v for n, v in reach[id].margins.items() if n not in arm}
            assert (reach[id].outcome, margins) == (verdict.outcome, verdict.margins)


def test_without_warp_one_line_says_what_to_install(
    arguments: list[str], tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    version = importlib.metadata.version

    def without_warp(package: str) -> str:
        if package == "warp-lang":
            raise importlib.metadata.PackageNotFoundError(package)
        return version(package)

    monkeypatch.setattr("importlib.metadata.version", without_warp)
    given = [*arguments, "-o", str(tmp_path / "run"), "--engine", "mujoco-gpu"]
    assert main(given) != 0
    (line,) = capsys.readouterr().err.splitlines()
    assert "engine mujoco-gpu needs warp-lang 1.19.0, which is not installed" in line
    assert "pip install 'burg-drake[gpu]'" in line
    assert not (tmp_path / "run").exists()


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
