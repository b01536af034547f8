"""`evaluate`, `replay`, `grasps show` and `report` on grasps whose outcomes are known."""

from __future__ import annotations

import dataclasses
import re
import shutil
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps import main, retry_advice
from burg_drake.core import GraspSet, Outcome, Stage, UnknownNameError, Verdict, grasp_from_axes
from burg_drake.evaluation import Journal, Run, load_run, save_run

Capture = pytest.CaptureFixture[str]


def test_the_run_has_the_outcomes_that_its_grasps_must_have(run: Run) -> None:
    assert run.results["outcome"].tolist() == ["lifted", "collision_target", "no_contact"]


def test_evaluate_given_grasps(tmp_path: Path, capsys: Capture) -> None:
    above = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.0, 0.0, 0.3))
    GraspSet.create(above, object="box").save(tmp_path / "grasps.npz")
    arguments = ["evaluate", "tabletop_six", "-o", str(tmp_path / "run"), "--mode", "hand"]
    arguments += ["--grasps", str(tmp_path / "grasps.npz"), "--engine", "screening", "--quiet"]
    assert main([*arguments, "--workers", "1", "--seed", "3"]) == 0
    out = capsys.readouterr().out
    assert f"table   {tmp_path / 'run' / 'results.csv'}" in out
    assert "no_contact: the fingers closed without touching the object" in out
    assert "best " not in out and "--grasp ID" not in out
    run = load_run(tmp_path / "run")
    asked = (run.document.engine.name, run.document.seed, run.document.mode)
    assert asked == ("screening", 3, "hand")
    assert main([*arguments, "--workers", "1", "--seed", "4"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "holds another run (seed is 3 there, 4 here)" in line


def test_grasps_of_an_object_that_is_not_there(tmp_path: Path, capsys: Capture) -> None:
    GraspSet.create(np.eye(4), object="scissors").save(tmp_path / "grasps.npz")
    arguments = ["evaluate", "tabletop_six", "-o", str(tmp_path / "run")]
    assert main([*arguments, "--grasps", str(tmp_path / "grasps.npz")]) == 2
    assert "has grasps of object 'scissors', which is not in scene 'tabletop_six'" in (
        capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--grasps-per-object", "0"], "'0' is not a whole number from 1"),
        (["--grasps-per-object", "many"], "'many' is not a whole number from 1"),
        (["--approach-angle", "0"], "0 is not an angle in degrees above 0, at most 180"),
        (["--approach-angle", "200"], "200 is not an angle in degrees above 0, at most 180"),
        (["--approach-angle", "steep"], "'steep' is not a finite number"),
        (["--seed", "-1"], "'-1' is not a whole number from 0"),
        (["--workers", "0"], "'0' is not a whole number from 1"),
        (["--workers", "100000"], "'100000' is not a whole number from 1 to 1,024"),
        (["--grasps-per-object", "9" * 5000], "999...999"),
        (["--mode", "leg"], "invalid choice: 'leg'"),
        (["--station", "wsg_tabletop", "--mode", "arm"], "mode 'arm' needs an arm, which station"),
        (["--engine", "fast"], "invalid choice: 'fast'"),
        (["--station", "nowhere"], "nowhere does not exist"),
        (["--grasps", "nowhere.npz"], "nowhere.npz does not exist"),
        (["--grasps", "a.npz", "--grasps-per-object", "100"], "not allowed with argument --grasps"),
        (["-o", "/dev/null"], "cannot write to folder /dev/null"),
    ],
)
def test_bad_arguments(arguments: list[str], message: str, tmp_path: Path, capsys: Capture) -> None:
    output = [] if "-o" in arguments else ["-o", str(tmp_path / "run")]
    try:
        code = main(["evaluate", "tabletop_six", *output, *arguments])
    except SystemExit as ended:
        code = ended.code  # type: ignore[assignment]
    assert code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("burg-drake: error: ") and message in line


def test_failures_to_report_end_with_1(
    run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Capture
) -> None:
    failed = run.results["id"][:2].tolist()
    monkeypatch.setattr(Run, "failures", failed)
    monkeypatch.setattr("burg_drake.evaluation.evaluate", lambda *a, **k: run)
    assert main(["evaluate", "tabletop_six", "-o", str(tmp_path / "run")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"burg-drake: 2 of 3 grasps could not be simulated, such as {failed[0]}")


def test_what_was_ended_from_outside_is_tried_again_by_the_same_command(
    run: Run, tmp_path: Path, capsys: Capture
) -> None:
    """A journal in which memory ran out at one grasp, and another one could not be stepped."""
    killed, failed = run.results["id"][[0, 2]].tolist()
    shutil.copytree(run.path, tmp_path / "run")
    with Journal(tmp_path / "run" / "journal.jsonl") as journal:
        for id in (killed, failed):
            lost = Verdict(Outcome.SIMULATION_FAILED, Stage.EXECUTED, interrupted=id == killed)
            journal.append(id, lost)
    run.candidates.grasps.save(tmp_path / "grasps.npz")
    scene = str(run.path.with_suffix(".yaml"))
    command = ["evaluate", scene, "-o", str(tmp_path / "run"), "--mode", "hand"]
    command += ["--grasps", str(tmp_path / "grasps.npz"), "--workers", "1", "--quiet"]
    command += ["--engine", "screening"]
    assert main(command) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line == (
        f"burg-drake: 1 of 3 grasps could not be simulated, such as {failed}; reasons are in"
        f" {tmp_path / 'run' / 'results.csv'}; --retry-failed tries them again"
    )
    assert main([*command, "--retry-failed"]) == 0
    again = load_run(tmp_path / "run")
    assert again.results["outcome"].tolist() == run.results["outcome"].tolist()


@pytest.mark.parametrize(
    ("interrupted", "failed", "said"),
    [
        (0, 2, r"^--retry-failed tries them again$"),
        (2, 2, r"^2 of them because .* ended from outside, .* the same command tries these again"),
        (1, 2, r"^1 of them .*, --retry-failed all$"),
    ],
)
def test_how_to_try_again_is_said(interrupted: int, failed: int, said: str) -> None:
    assert re.search(said, retry_advice(interrupted, failed))


def test_interrupted_evaluation_says_how_to_go_on(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Capture
) -> None:
    def interrupt(*arguments: object, **options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("burg_drake.evaluation.evaluate", interrupt)
    assert main(["evaluate", "tabletop_six", "-o", str(tmp_path / "run")]) == 130
    assert capsys.readouterr().err == (
        "burg-drake: interrupted; run the same command to continue\n"
    )


def self_contained(page: Path) -> bool:
    return not re.search(r"<(script|img|link)[^>]*(src|href)=", page.read_text())


def test_replay_of_the_best(run: Run, tmp_path: Path, capsys: Capture) -> None:
    page = tmp_path / "replay.html"
    assert main(["replay", str(run.path), "--best", "--html", str(page)]) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0] == "lifted"
    assert out[1].startswith("lift 300 mm, slip ")
    assert out[2] == "as recorded"
    assert out[-1] == f"wrote {page}"
    assert self_contained(page)
    assert f"<title>tabletop_two: {run.best()[0]}</title>" in page.read_text()


def test_replay_live(run: Run, capsys: Capture) -> None:
    collides = str(run.results["id"][1])
    assert main(["replay", str(run.path), "--grasp", collides, "--no-wait"]) == 0
    captured = capsys.readouterr()
    assert re.match(r"collision target \(box, \d+\.\d mm deep\)\nas recorded\n", captured.out)
    assert captured.err == "nothing moves: the trial ended before its first step\n"


def altered(run: Run, folder: Path, verdict: Verdict, **versions: str) -> Path:
    """A copy of the run with another verdict on its second grasp."""
    shutil.copytree(run.path, folder)
    document = run.document
    document = dataclasses.replace(document, versions={**document.versions, **versions})
    save_run(Run(folder, document))
    with Journal(folder / "journal.jsonl") as journal:  # the last line about a grasp counts
        journal.append(str(run.results["id"][1]), verdict)
    return folder


@pytest.mark.parametrize(
    ("verdict", "versions", "line"),
    [
        (Verdict(Outcome.NO_IK, Stage.REACHABLE), {}, "differs from what was recorded"),
        (
            Verdict(Outcome.SIMULATION_FAILED, Stage.EXECUTED),
            {"drake": "1.2.3"},
            f"differs from what was recorded (with drake 1.2.3, now {version('drake')})",
        ),
    ],
)
def test_replay_that_ends_unlike_the_run(
    verdict: Verdict,
    versions: dict[str, str],
    line: str,
    run: Run,
    tmp_path: Path,
    capsys: Capture,
) -> None:
    other = altered(run, tmp_path / "other", verdict, **versions)
    id = str(run.results["id"][1])
    assert main(["replay", str(other), "--grasp", id, "--no-wait"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("collision target") and lines[1] == line
    assert lines[2] == f"outcome: recorded '{verdict.outcome}', now 'collision_target'"


def test_replay_compares_with_the_engine_of_the_row(
    run: Run, tmp_path: Path, capsys: Capture
) -> None:
    header, row, *_ = run.table_path.read_text().splitlines()
    assert "whole_trial=False" in row
    path = tmp_path / "row.csv"
    changed = row.replace("whole_trial=False", "whole_trial=True")
    path.write_text(f"{header}\n{changed}\n")
    assert main(["replay", str(path), "--no-wait"]) == 2
    assert "engine 'screening' and engine_settings contradict" in capsys.readouterr().err
    changed = changed.replace(",screening,", ",screening (custom),")
    path.write_text(f"{header}\n{changed}\n")
    assert main(["replay", str(path), "--no-wait"]) == 1
    out = capsys.readouterr().out.splitlines()
    (end,) = (line for line in out if line.startswith("end_time: recorded"))
    recorded, now = map(float, re.findall(r"[\d.]+", end.removeprefix("end_time")))
    assert now > recorded + 1.0  # which the row has from a trial that ended once it was decided


def test_replay_of_an_unknown_grasp(run: Run, capsys: Capture) -> None:
    known = str(run.results["id"][0])
    assert main(["replay", str(run.path), "--grasp", known[:-1] + "x"]) == 2
    assert f"did you mean {known}" in capsys.readouterr().err


def test_replay_needs_a_choice(run: Run, capsys: Capture) -> None:
    assert main(["replay", str(run.path)]) == 2
    assert "has 3 rows; give --grasp ID, --row N or --best" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["replay", str(run.path), "--best", "--row", "1"])
    assert main(["replay", str(run.path), "--row", "4"]) == 2
    assert "has no row 4; it has 3" in capsys.readouterr().err


def test_replay_of_the_best_where_nothing_was_lifted(
    run: Run, tmp_path: Path, capsys: Capture
) -> None:
    header, _, *rows = run.table_path.read_text().splitlines()
    (tmp_path / "rest.csv").write_text("\n".join([header, *rows]))
    assert main(["replay", str(tmp_path / "rest.csv"), "--best"]) == 2
    assert "rest.csv: no grasp was lifted; choose one with --grasp ID" in capsys.readouterr().err


@pytest.mark.parametrize("verb", [["replay", "--best"], ["grasps", "show"], ["report"]])
def test_no_run_there(verb: list[str], tmp_path: Path, capsys: Capture) -> None:
    assert main([*verb, str(tmp_path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(
        f"burg-drake: error: {tmp_path} is not the folder of a run (run.yaml is missing)"
    )


def test_grasps_in_colour(run: Run, tmp_path: Path, capsys: Capture) -> None:
    page = tmp_path / "grasps.html"
    assert main(["grasps", "show", str(run.path), "--html", str(page)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "note: there are no grasps to judge for mug",
        "■ lifted (1)",
        "■ never held (1)",
        "■ hand collides (1)",
        f"wrote {page}",
    ]
    assert self_contained(page)
    text = page.read_text()
    assert "3 of 3 grasps" in text
    assert 'data-paths="/drake/grasps/lifted"' in text


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--outcome", "lifted,dropped"], "■ lifted (1)"),
        (["--only", "box", "--most", "1"], "■ lifted (1)"),
    ],
)
def test_choice_of_grasps(run: Run, options: list[str], line: str, capsys: Capture) -> None:
    assert main(["grasps", "show", str(run.path), "--no-wait", *options]) == 0
    shown = [text for text in capsys.readouterr().out.splitlines() if text.startswith("■")]
    assert shown == [line]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--only", "bux"], "has no grasps of 'bux'; did you mean 'box'? Known: box"),
        (["--outcome", "dropped"], "has no such grasps; choose other outcomes"),
        (["--outcome", "lifte"], "'lifte' is not an outcome; did you mean 'lifted'? Known: "),
    ],
)
def test_bad_choice_of_grasps(run: Run, options: list[str], message: str, capsys: Capture) -> None:
    try:
        code = main(["grasps", "show", str(run.path), *options])
    except SystemExit as ended:
        code = ended.code  # type: ignore[assignment]
    assert code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line


def test_every_outcome_can_be_chosen(run: Run, capsys: Capture) -> None:
    arguments = ["grasps", "show", str(run.path), "--no-wait", "--outcome", ",".join(Outcome)]
    assert main(arguments) == 0


def test_report(run: Run, capsys: Capture) -> None:
    run.report_path.unlink()
    assert main(["report", str(run.path)]) == 0
    out = capsys.readouterr().out
    assert "collision_target" in out
    assert out.endswith(f"report  {run.report_path}\n")
    assert run.report_path.exists()


def test_a_changed_library_is_noticed(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def changed(self: Run) -> None:
        raise UnknownNameError("the library changed")

    monkeypatch.setattr(Run, "scene", changed)
    assert main(["replay", str(run.path), "--best"]) == 2


def test_replay_of_an_empty_id_is_not_the_best(run: Run, capsys: Capture) -> None:
    assert main(["replay", str(run.path), "--grasp", ""]) == 2
    assert "has no judged grasp ''" in capsys.readouterr().err
