"""`reach`: what it prints and writes about grasps whose answers geometry demands."""

from __future__ import annotations

import resource
from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.core import GraspSet, grasp_from_axes, make_pose, resolve_reference
from burg_drake.evaluation import read_table
from tests.apps.conftest import TWO

ABOVE = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.0, 0.0, 0.18))
"""Across the narrow side of the household box, from above."""
GRASPS = np.stack([ABOVE, ABOVE @ make_pose(p_AB=(0, 0, 0.1))])
Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def two(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the folder of the test, mug and box."""
    monkeypatch.chdir(tmp_path)
    Path("two.yaml").write_text(TWO)


@pytest.fixture
def grasps(tmp_path: Path) -> Path:
    path = tmp_path / "grasps.npz"
    GraspSet.create(GRASPS, object="box", width=0.06).save(path)
    return path


def reach(grasps: Path, *options: str) -> int:
    common = ["--screening", "--workers", "1", "--quiet"]
    return main(["reach", "two.yaml", "--grasps", str(grasps), *common, *options])


def test_a_table_and_plans(grasps: Path, tmp_path: Path, capsys: Capture) -> None:
    table, plans = tmp_path / "reach.csv", tmp_path / "plans"
    assert reach(grasps, "-o", str(table), "--plans", str(plans)) == 0
    out = capsys.readouterr().out
    rows = [line.split() for line in out.splitlines() if line.strip()]
    assert ["box", "2", "1", "1", "100", "%"] in rows and ["mug", "0", "0", "0", "-"] in rows
    assert "note: there are no grasps to judge for mug" in out
    assert ["reachable", "·", "1", "1", "50.0", "%"] in rows
    assert ["collision_target", "·", "1", "1", "50.0", "%", "box", "(1)"] in rows
    assert "clear grasps per CPU second" in out and f"1 plans are in {plans}" in out
    found = read_table(table)
    assert found["outcome"].tolist() == ["reachable", "collision_target"]
    assert [path.name for path in plans.glob("*-*.json")] == [f"{found['id'][0]}.json"]
    before = {path: path.read_bytes() for path in (table, *plans.iterdir())}
    assert reach(grasps, "-o", str(table), "--plans", str(plans)) == 0
    assert {path: path.read_bytes() for path in (table, *plans.iterdir())} == before


def test_only_what_is_reachable_is_written(grasps: Path, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "feasible.h5"
    assert reach(grasps, "-o", str(out), "--only-reachable") == 0
    assert f"wrote 1 grasps to {out}" in capsys.readouterr().out
    found = GraspSet.load(out)
    np.testing.assert_array_equal(found.X_OG, GRASPS[:1])
    assert found.column("outcome").tolist() == ["reachable"]
    assert found.provenance["reach"]["exact"] is False


def test_plans_that_cannot_be_written_are_counted(
    grasps: Path, tmp_path: Path, capsys: Capture
) -> None:
    """No file may grow beyond 100 kB, and a plan needs more than ten times that."""
    table, plans = tmp_path / "reach.csv", tmp_path / "plans"
    usual = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, usual[1]))
    try:
        assert reach(grasps, "-o", str(table), "--plans", str(plans)) == 1
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, usual)
    captured = capsys.readouterr()
    assert f"0 plans are in {plans}" in captured.out and not any(plans.glob("*-*"))
    found = read_table(table)
    assert found["outcome"].tolist() == ["reachable", "collision_target"]
    name = plans / f"{found['id'][0]}.json"
    assert captured.err == (
        f"burg-drake: 1 of 1 grasps have no plan, such as {found['id'][0]}: InvalidInputError:"
        f" cannot write {name}: File too large; choose a writable place\n"
    )


def test_plans_of_an_earlier_call_are_left_alone(
    grasps: Path, tmp_path: Path, capsys: Capture
) -> None:
    (tmp_path / "plans").mkdir()
    (tmp_path / "plans" / "box-1.csv").write_text("")
    assert reach(grasps, "--plans", str(tmp_path / "plans")) == 2
    assert capsys.readouterr().err == (
        f"burg-drake: error: folder {tmp_path / 'plans'} has box-1.csv in it, but"
        " no plans.yaml; plans need a folder of their own: choose another one, or empty it\n"
    )


@pytest.mark.parametrize("verb", ["reach", "evaluate"])
def test_a_board_out_of_reach_is_one_line(
    grasps: Path, tmp_path: Path, verb: str, capsys: Capture
) -> None:
    text = resolve_reference("panda_tabletop", "stations").read_text(encoding="utf-8")
    for old, new in (
        ("X_WS: {translation: [0.24,", "X_WS: {translation: [1.5,"),
        ("size: [1.2, 1.4, 0.1]", "size: [5.0, 1.4, 0.1]"),
    ):
        assert old in text
        text = text.replace(old, new)
    station = tmp_path / "mine.yaml"
    station.write_text(text, encoding="utf-8")
    out = tmp_path / "out.csv"
    options = ["--grasps", str(grasps), "--station", str(station), "-o", str(out), "--quiet"]
    assert main([verb, "tabletop_six", *options]) == 2
    assert capsys.readouterr().err == (
        f"burg-drake: error: {station}: no part of the board is within reach: its nearest point is"
        " 1.54 m from the arm's shoulder, and the arm reaches 0.95 m at most; change X_WS or"
        " arm.X_WA\n"
    )
    assert not out.exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--only-reachable"], "--only-reachable is for the output file; add -o OUT"),
        (["--retry-failed"], "--retry-failed is for plan files; add --plans DIR"),
        (["--station", "wsg_tabletop"], "station 'wsg_tabletop' has no arm"),
        (["-o", "/dev/null/reach.csv"], "/dev/null"),
        (["-o", "reach.xyz"], "(--to)"),
        (["--plans", "/dev/null/plans"], "/dev/null"),
        (["--grasps-per-object", "3"], "not allowed with argument --grasps"),
    ],
)
def test_what_cannot_be_used_is_said_in_one_line(
    grasps: Path, options: list[str], message: str, capsys: Capture
) -> None:
    try:
        code = reach(grasps, *options)
    except SystemExit as ended:  # the parser's own errors
        code = int(str(ended.code))
    assert code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
