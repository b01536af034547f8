"""`replay` of a row that was copied away from its run: found, compared bit for bit, recorded.

A can stands on a box, so that a grasp that lifts the box disturbs the can, whatever the physics.
"""

from __future__ import annotations

import csv
import dataclasses
import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.core import GraspSet, Outcome, grasp_from_axes, make_pose, rotation_from_rpy
from burg_drake.evaluation import (
    EvaluationSettings,
    Run,
    evaluate,
    read_table,
    table_row,
    trial_columns,
    write_table,
)
from burg_drake.simulation import HandTrial
from burg_drake.station import ENGINES, GraspMotion

SCENE = """\
version: 1
name: stack
library: household
instances:
  - object: box
    X_SO: {translation: [0.3, 0.2, 0.0]}
  - object: can
    X_SO: {translation: [0.3, 0.2, 0.21]}
"""
SIDE = grasp_from_axes((1, 0, 0), (0, 1, 0), (0.0, -0.065, 0.16))
"""Across the narrow side of the household box, from the side, below the can."""
TURN = make_pose(rotation_from_rpy([0.0123, 0.0234, 0.0345]))
"""A turn whose matrix no quaternion gives back bit for bit."""
ENGINE = dataclasses.replace(ENGINES["screening"], time_step=0.01)
"""Not a preset, though it has the name of one; fast."""
LOW = GraspMotion(lift_height=0.1)
Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A grasp that lifts the box with the can on it, one in the can, and one in thin air."""
    folder = tmp_path_factory.mktemp("stack")
    (folder / "stack.yaml").write_text(SCENE)
    clutter = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.0, 0.05, 0.19))
    grasps = np.stack([SIDE @ TURN, clutter, SIDE @ make_pose(p_AB=(0, 0, -0.2))])
    return evaluate(
        folder / "stack.yaml",
        "panda_tabletop",
        folder / "run",
        settings=EvaluationSettings(engine=ENGINE, mode="hand", motion=LOW, tilt_limit_deg=180),
        grasps={"box": GraspSet.create(grasps, object="box", width=0.06)},
        workers=1,
        progress=False,
    )


@pytest.fixture
def row_file(run: Run, tmp_path: Path) -> Path:
    """The first row on its own in another folder, as one would paste it into a mail."""
    lines = run.table_path.read_text().splitlines()[:2]
    path = tmp_path / "from a mail.csv"
    path.write_text("\n".join(lines))
    return path


def rewrite(path: Path, **cells: str) -> None:
    """Puts other texts into a table of one row."""
    with path.open(newline="") as file:
        (row,) = csv.DictReader(file)
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, row)
        writer.writeheader()
        writer.writerow({**row, **cells})


def replay(path: Path, *options: str) -> int:
    return main(["replay", str(path), "--no-wait", *options])


@pytest.mark.thorough
def test_what_stands_on_the_target_is_disturbed(run: Run) -> None:
    outcomes = [Outcome.LIFTED_DISTURBED, Outcome.COLLISION_CLUTTER, Outcome.NO_CONTACT]
    assert run.results["outcome"].tolist() == outcomes
    lifted = table_row(run.results, 0)
    assert lifted["moved_can"] == lifted["others_moved"] > 0.05  # it rose, whatever it did then
    assert lifted["patch_area"] > 0.0
    assert np.isnan(run.results["moved_box"]).all()
    # it stands on the box and is free from the start with it: both fall for a step, then the box
    # touches the table, and the can falls for another one until it touches the box: (1 + 2) g dt^2
    sunk = 3.03 * 9.81 * ENGINE.time_step**2
    assert np.isnan(run.results["moved_can"][1]) and run.results["moved_can"][2] <= sunk
    assert set(run.results["engine"].tolist()) == {"screening (custom)"}


def test_a_row_alone_is_replayed_to_the_same_bits(
    run: Run, row_file: Path, tmp_path: Path, capsys: Capture
) -> None:
    page = tmp_path / "page.html"
    assert main(["replay", str(row_file), "--html", str(page)]) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0] == "lifted disturbed"
    assert "as recorded" in out
    far = run.results["moved_can"][0] * 1e3
    assert f"moved can {far:.1f} mm" in out
    assert f"<title>stack: {run.candidates.id[0]}</title>" in page.read_text()


def test_the_last_bit_of_a_margin_is_compared(row_file: Path, capsys: Capture) -> None:
    slip = float(read_table(row_file)["slip"][0])
    rewrite(row_file, slip=repr(math.nextafter(slip, 1.0)))
    assert replay(row_file) == 0
    assert "as recorded, except for the last digits of slip" in capsys.readouterr().out
    rewrite(row_file, slip=repr(1.001 * slip))
    assert replay(row_file) == 1
    out = capsys.readouterr().out.splitlines()
    assert "differs from what was recorded" in out
    assert f"slip: recorded {1.001 * slip!r}, now {slip!r}" in out


@pytest.mark.parametrize(("row", "first"), [("2", "collision clutter (can, "), ("3", "no contact")])
def test_rows_are_counted_from_1(run: Run, row: str, first: str, capsys: Capture) -> None:
    assert replay(run.table_path, "--row", row) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0].startswith(first) and "as recorded" in out


def test_a_grasp_of_a_table(run: Run, tmp_path: Path, capsys: Capture) -> None:
    table = tmp_path / "copy.csv"
    shutil.copy(run.table_path, table)
    id = run.candidates.id[1]
    assert replay(table, "--grasp", id) == 0
    assert replay(table, "--grasp", f"{id[:-1]}x") == 2
    assert f"copy.csv has no judged grasp '{id[:-1]}x'; did you mean" in capsys.readouterr().err
    text = table.read_text()
    table.write_text(text + "".join(text.splitlines(keepends=True)[1:]))
    assert replay(table, "--grasp", id) == 2
    assert f"has 2 rows of {id}, the first is row 2; choose one with --row" in (
        capsys.readouterr().err
    )


@pytest.mark.thorough
def test_a_scene_that_is_gone_or_changed(run: Run, row_file: Path, capsys: Capture) -> None:
    content = run.document.scene.content[:12]
    rewrite(row_file, scene="/nowhere/stack.yaml")
    assert replay(row_file) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"row 1 needs the scene with content {content}" in line
    assert (
        "/nowhere/stack.yaml does not exist" in line
        and "give its file" in line
        and "(--scene" in line
    )
    assert replay(row_file, "--scene", str(run.path / "scene.yaml")) == 0
    assert "as recorded" in capsys.readouterr().out

    changed = row_file.parent / "changed.yaml"
    changed.write_text(SCENE.replace("0.2, 0.21", "0.21, 0.21"))
    assert replay(row_file, "--scene", str(changed)) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"{changed} has content" in line and "--force" in line
    assert replay(row_file, "--scene", str(changed), "--force") == 1
    captured = capsys.readouterr()
    assert "the scene is not the one of the trial" in captured.err
    assert "differs from what was recorded" in captured.out


@pytest.mark.thorough
def test_a_trial_with_another_friction_is_replayed_with_it(
    run: Run, tmp_path: Path, capsys: Capture
) -> None:
    from burg_drake.evaluation import origin_of, trial_verdict

    trial = dataclasses.replace(run.trial(run.candidates.id[0]), friction=0.01, mass=0.5)
    result = HandTrial(run.scene(), run.station(), engine=ENGINE, motion=LOW).run(
        "box", trial.X_OG, friction=0.01, mass=0.5
    )
    assert result.outcome is not Outcome.LIFTED_DISTURBED  # 2 mu N = 0.8 N hold 80 g
    trial = dataclasses.replace(trial, verdict=trial_verdict(result))
    table = trial_columns([trial], origin_of(run.document), instances=["box", "can"])
    write_table(tmp_path / "slippery.csv", table)
    assert replay(tmp_path / "slippery.csv") == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0] == result.outcome.value.replace("_", " ") and "as recorded" in out
    rewrite(tmp_path / "slippery.csv", friction="", mass="")
    assert replay(tmp_path / "slippery.csv") == 1


@pytest.mark.thorough  # as `evaluation/test_arm_mode` and `visualization/test_arm_replay`
def test_a_row_of_an_arm_trial_is_replayed_with_the_arm(tmp_path: Path, capsys: Capture) -> None:
    above = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.0, 0.0, 0.18))
    (tmp_path / "box.yaml").write_text(SCENE.partition("  - object: can")[0])
    run = evaluate(
        tmp_path / "box.yaml",
        "panda_tabletop",
        tmp_path / "run",
        settings=EvaluationSettings(engine=ENGINE, mode="arm", motion=LOW),
        grasps={"box": GraspSet.create(above, object="box", width=0.06)},
        workers=1,
        progress=False,
    )
    table, page = tmp_path / "row.csv", tmp_path / "page.html"
    shutil.copy(run.table_path, table)
    assert replay(table, "--html", str(page)) == 0
    out = capsys.readouterr().out
    assert out.startswith("lifted\n") and "\nas recorded\n" in out
    duration = run.results["duration"][0]
    assert "tracking error" in out and f"planned motion {duration:.2f} s" in out
    assert page.exists()


def test_what_is_no_table_is_said(tmp_path: Path, capsys: Capture) -> None:
    assert replay(tmp_path / "none.csv") == 2
    assert "none.csv: No such file or directory\n" in capsys.readouterr().err
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    assert replay(tmp_path / "other.csv") == 2
    assert "other.csv is not a results table (it has no column id)" in capsys.readouterr().err
    (tmp_path / "README.md").write_text("# Results\n")
    assert replay(tmp_path / "README.md", "--row", "1") == 2
    assert capsys.readouterr().err == (
        f"burg-drake: error: {tmp_path}/README.md is neither the folder of a run nor a table of"
        " results (.csv, .parquet)\n"
    )


def test_a_header_alone_has_no_rows(row_file: Path, capsys: Capture) -> None:
    row_file.write_text(row_file.read_text().splitlines()[0] + "\n")
    for choice in ([], ["--row", "1"], ["--best"], ["--grasp", "box-1"]):
        assert replay(row_file, *choice) == 2
        assert capsys.readouterr().err == f"burg-drake: error: {row_file} has no rows\n"


TWELVE = "it must be the 12 numbers of the upper three rows of the pose"


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ({"trial_settings": ""}, "trial_settings is empty, without which a row alone cannot be"),
        ({"scene_content": ""}, "scene_content is empty, without which a row alone cannot be"),
        ({"engine": "warp (custum)"}, "engine 'warp (custum)' is not a preset of this release"),
        ({"engine": "screening"}, "engine 'screening' and engine_settings contradict each other"),
        ({"X_OG": "1 0 0 0.1"}, f"X_OG has 4 numbers; {TWELVE}"),
        ({"X_OG": "1 0 0 x"}, f"X_OG contains 'x'; {TWELVE}"),
        ({"outcome": "liftd"}, "outcome 'liftd' is not known to this release; did you mean 'lif"),
        ({"stage": "dreamt"}, "stage 'dreamt' is not known to this release; known: clear, exec"),
    ],
)
def test_a_damaged_row_is_refused(
    row_file: Path, capsys: Capture, cells: dict[str, str], message: str
) -> None:
    rewrite(row_file, **cells)
    assert replay(row_file) == 2
    expected = f"burg-drake: error: {row_file}, row 1: {message}"
    assert capsys.readouterr().err.startswith(expected)
