"""`burg-drake robustness` on a run with one lifted grasp."""

from __future__ import annotations

import csv
import dataclasses
import shutil
from pathlib import Path

import pytest

from burg_drake.apps import main
from burg_drake.core import InvalidInputError, Outcome, Progress, Stage, Verdict, describe_column
from burg_drake.evaluation import (
    Journal,
    RobustnessSettings,
    Run,
    assess_robustness,
    load_run,
    read_journal,
    read_table,
    robustness as tested,
)
from burg_drake.simulation import Grip, HandTrial, friction_limit, success_rate, take_grip, tug
from burg_drake.station import ENGINES
from tests.apps.conftest import box_run

Capture = pytest.CaptureFixture[str]

OPTIONS = ["--tests", "tug,friction,noise", "--repeats", "3", "--workers", "1", "--quiet"]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The run of the other tests with twice their time step: here much is simulated."""
    engine = dataclasses.replace(ENGINES["screening"], time_step=0.01)
    return box_run(tmp_path_factory.mktemp("coarse") / "box", engine)


@pytest.fixture(scope="module")
def copied(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A run of its own, tested once."""
    folder = tmp_path_factory.mktemp("robustness") / "run"
    shutil.copytree(run.path, folder)
    copied = load_run(folder)
    assert main(["robustness", str(folder), *OPTIONS]) == 0
    return copied


def test_the_table_has_what_the_functions_say(copied: Run) -> None:
    table = read_table(copied.path / "robustness.csv")
    (id,) = copied.best()
    assert table["id"].tolist() == [id]
    assert all(map(describe_column, table))
    candidate = copied.candidate(id)
    trial = HandTrial(copied.scene(), copied.station(), engine=copied.document.engine)
    grip = take_grip(trial, candidate.instance, candidate.X_OG)
    assert isinstance(grip, Grip)
    found = tug(grip, directions=("+x", "-z"))
    for name, value in found.accelerations.items():
        assert table[f"tug_{name}_g"][0] == value
        assert table[f"tug_{name}_N"][0] == pytest.approx(value * grip.weight)
    assert table["friction_min"][0] == friction_limit(trial, "box", candidate.X_OG)
    rate = success_rate(trial, "box", candidate.X_OG, repeats=3, grasp=id)
    assert (table["repeats"][0], table["lifted"][0]) == (3, rate.lifted)
    assert (table["success_low"][0], table["success_high"][0]) == rate.interval
    for outcome, count in rate.outcomes.items():
        assert table[f"n_{outcome}"][0] == count
    assert sum(values[0] for name, values in table.items() if name.startswith("n_")) == 3
    assert table["shake_x_g"][0] != table["shake_x_g"][0]  # not asked for


def test_an_interrupted_test_goes_on_with_the_same_result(copied: Run, tmp_path: Path) -> None:
    table, journal = copied.path / "robustness.csv", copied.path / "robustness.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    assert len(lines) == 5
    (tmp_path / "again.jsonl").write_bytes(b"".join(lines[:2]) + lines[2][:40])
    again = tmp_path / "again.csv"
    assert main(["robustness", str(copied.path), *OPTIONS, "-o", str(again)]) == 0
    assert again.read_bytes() == table.read_bytes()
    assert (tmp_path / "again.jsonl").read_bytes().startswith(b"".join(lines[:2]))
    assert len((tmp_path / "again.jsonl").read_bytes().splitlines()) == 5


@pytest.mark.parametrize(("interrupted", "options"), [(True, []), (False, ["--retry-failed"])])
def test_tests_that_could_not_be_simulated_are_tried_again(
    copied: Run, tmp_path: Path, interrupted: bool, options: list[str]
) -> None:
    table, journal = copied.path / "robustness.csv", tmp_path / "again.jsonl"
    shutil.copy(copied.path / "robustness.jsonl", journal)
    lost = Verdict(Outcome.SIMULATION_FAILED, Stage.EXECUTED, interrupted=interrupted)
    noise = [id for id in read_journal(journal) if ":noise:1:" in id]
    with Journal(journal) as opened:
        opened.append(noise[0], lost)
    command = ["robustness", str(copied.path), *OPTIONS, "-o", str(tmp_path / "again.csv")]
    assert main([*command, *options]) == 0
    assert (tmp_path / "again.csv").read_bytes() == table.read_bytes()
    assert len(journal.read_bytes().splitlines()) == 7


def test_it_says_at_once_how_long_it_takes(copied: Run, tmp_path: Path) -> None:
    """From what the run's own trial took; noise alone is a part of it."""
    events: list[Progress] = []

    class Enough(Exception):
        pass

    def first(event: Progress) -> None:
        events.append(event)
        raise Enough

    for tests in (("noise",), ("noise", "tug")):
        settings = RobustnessSettings(tests=tests, repeats=4)
        with pytest.raises(Enough):
            assess_robustness(
                copied, settings=settings, out=tmp_path / "r.csv", workers=2, progress=first
            )
    (id,) = copied.best()
    trial = copied.verdicts[id].cpu[Stage.EXECUTED]
    assert [(e.done, e.total, e.unit) for e in events] == [(0, 4, "tests"), (0, 5, "tests")]
    noise, both = (e.remaining for e in events)
    assert noise is not None and both is not None
    assert 2 * trial < noise < 10 * trial < both < 60 * trial


@pytest.mark.thorough
def test_two_workers_and_no_journal_give_the_same_bits(copied: Run, tmp_path: Path) -> None:
    """Of the tests that take less time: four tasks, each of which either worker may take."""
    out = tmp_path / "two.csv"
    options = ["--tests", "friction,noise", "--repeats", "3", "--workers", "2", "-o", str(out)]
    assert main(["robustness", str(copied.path), *options, "--quiet"]) == 0
    with out.open(newline="") as two, (copied.path / "robustness.csv").open(newline="") as one:
        (found,), (expected,) = csv.DictReader(two), csv.DictReader(one)
    assert found["friction_min"] and found["success"]
    tug = {name for name in expected if name.startswith("tug_")}
    assert found | dict.fromkeys(tug) == expected | dict.fromkeys(tug)


def test_what_is_known_is_not_asked_again(copied: Run, monkeypatch, capsys: Capture) -> None:
    asked = []
    judge_all = tested.judge_all
    monkeypatch.setattr(
        tested, "judge_all", lambda todo, *a, **k: asked.extend(todo) or judge_all(todo, *a, **k)
    )
    assert main(["robustness", str(copied.path), *OPTIONS]) == 0
    assert asked == []
    out = capsys.readouterr().out
    assert "Robustness of lifted grasps" in out and copied.best()[0] in out.replace("\n", "")
    assert f"table   {copied.path / 'robustness.csv'}" in out
    more = RobustnessSettings(tests=("noise",), repeats=4)
    found = assess_robustness(
        copied, settings=more, out=copied.path / "robustness.csv", workers=1, progress=False
    )
    assert [trial.id.split(":")[1] for trial in asked] == ["noise"]
    assert found.grasps[0].success is not None and found.grasps[0].success.trials == 4


def test_a_narrower_call_keeps_what_is_known(copied: Run, tmp_path: Path) -> None:
    shutil.copy(copied.path / "robustness.jsonl", tmp_path / "r.jsonl")
    command = ["robustness", str(copied.path), "--quiet", "-o", str(tmp_path / "r.csv")]
    assert main([*command, *OPTIONS]) == 0
    full = (tmp_path / "r.csv").read_bytes()
    for options in (["--tests", "tug"], ["--tests", "noise", "--repeats", "1"]):
        assert main([*command, *options]) == 0
        assert (tmp_path / "r.csv").read_bytes() == full
    with (tmp_path / "r.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["repeats"].isdigit() and row["lifted"].isdigit() and row["n_lifted"].isdigit()
    assert main([*command, "--tests", "tug", "--translation-mm", "2"]) == 0
    with (tmp_path / "r.csv").open(newline="") as file:
        (other,) = csv.DictReader(file)
    assert other["repeats"] == other["n_lifted"] == other["success"] == ""  # of other deviations
    assert other["tug_+x_g"] == row["tug_+x_g"] and other["friction_min"] == row["friction_min"]


@pytest.mark.thorough
def test_a_grasp_is_tested_by_the_engine_that_judged_it_again(run: Run, tmp_path: Path) -> None:
    shutil.copytree(run.path, tmp_path / "run")
    (id,) = run.best()
    with Journal(tmp_path / "run" / "journal.jsonl") as journal:
        journal.append(id, dataclasses.replace(run.verdicts[id], judged_again="screening"))
    again = load_run(tmp_path / "run")
    settings = RobustnessSettings(tests=("friction",))
    found = assess_robustness(again, settings=settings, workers=1, progress=False)
    assert read_table(found.table_path)["engine"].tolist() == ["screening"]
    candidate = again.candidate(id)
    trial = HandTrial(again.scene(), again.station(), engine="screening")
    assert found.grasps[0].friction_min == friction_limit(trial, "box", candidate.X_OG)
    # answers of the run's own engine are others
    (probe,) = read_journal(found.table_path.with_suffix(".jsonl"))
    (own,) = read_journal(
        assess_robustness(
            run, settings=settings, out=tmp_path / "own.csv", workers=1, progress=False
        ).table_path.with_suffix(".jsonl")
    )
    assert probe != own


def test_what_mujoco_judged_again_is_not_tugged(run: Run, tmp_path: Path) -> None:
    shutil.copytree(run.path, tmp_path / "run")
    (id,) = run.best()
    with Journal(tmp_path / "run" / "journal.jsonl") as journal:
        journal.append(id, dataclasses.replace(run.verdicts[id], judged_again="mujoco"))
    with pytest.raises(InvalidInputError, match=f"need Drake, but {id} was judged by engine muj"):
        assess_robustness(tmp_path / "run", workers=1, progress=False)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--grasp", "box-nothing"], "has no judged grasp 'box-nothing'"),
        (["--grasp", "COLLIDING"], "was not lifted (collision_target); robustness tests need"),
        (["--tests", "tug,pull"], "'pull' is not a test; known: friction, noise, shake, tug"),
        (["--repeats", "0"], "'0' is not a whole number from 1"),
        (["--translation-mm", "-1"], "-1 is below 0"),
        (["--best", "2", "--grasp", "a"], "not allowed with argument --best"),
        (
            ["-o", "rob"],
            "rob: the suffix does not say the format of the table; give a file that ends in .csv",
        ),
        (
            ["-o", "RUN/results.csv"],
            "results.csv belongs to the run itself; choose another file (--output)",
        ),
        (
            ["-o", "RUN/journal.csv"],
            "journal.jsonl belongs to the run itself; choose another file (--output)",
        ),
    ],
)
def test_bad_arguments(options: list[str], message: str, run: Run, capsys: Capture) -> None:
    colliding = run.results["id"][1]
    options = [colliding if option == "COLLIDING" else option for option in options]
    options = [option.replace("RUN", str(run.path)) for option in options]
    try:
        code = main(["robustness", str(run.path), *options])
    except SystemExit as ended:
        code = ended.code  # type: ignore[assignment]
    assert code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("burg-drake: error: ") and message in line
