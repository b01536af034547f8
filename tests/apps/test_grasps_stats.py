"""`burg-drake grasps stats`: what it prints, what it writes, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.core import GraspSet, make_pose
from burg_drake.evaluation import Run


def line(*millimetres: float, object: str = "mug") -> GraspSet:
    """Grasps at these places along x, the later the better."""
    spots = 1e-3 * np.array(millimetres)[:, None] * np.array([1.0, 0.0, 0.0])
    return GraspSet.create(make_pose(p_AB=spots), object=object, score=range(len(millimetres)))


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    """Grasps along a line, two of three of the first within 15 mm of the second."""
    a, b = tmp_path / "a.h5", tmp_path / "b.npz"
    line(0.0, 10.0, 100.0).with_columns(label=[0, 1, 0]).save(a)
    line(0.0, 24.0).with_columns(label=[1, 0]).save(b)
    return str(a), str(b)


def stats(*arguments: str, tmp_path: Path) -> dict[str, object]:
    path = tmp_path / "stats.json"
    assert main(["grasps", "stats", *arguments, "--json", str(path)]) == 0
    figures: dict[str, object] = json.loads(path.read_text())
    return figures


def test_one_set(files: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["grasps", "stats", files[0]]) == 0
    printed = capsys.readouterr().out
    rows = [line.split() for line in printed.splitlines()]
    assert ["mug", "3", "-", "0", "-", "1.000", "36.7"] in rows  # 10, 10 and 90 mm
    assert ["x", "[mm]", "3", "36.7", "0", "1", "10", "91", "100"] in rows
    assert "A and B" not in printed


def test_two_sets(
    files: tuple[str, str], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    figures = stats(*files, tmp_path=tmp_path)
    overall = figures["comparison"]["overall"]
    assert overall["coverage"] == {"count": 2, "total": 3, "share": pytest.approx(2 / 3)}
    assert overall["precision"] == {"count": 2, "total": 2, "share": 1.0}
    assert overall["to_grasps"]["quantiles"][-1] == pytest.approx(0.076)
    assert figures["comparison"]["shared_ids"] == 1
    assert figures["comparison"]["tolerance"]["distance"] is None
    assert figures["sets"][1] == {"file": files[1], "frame": "object"}
    assert figures["summaries"][0]["overall"]["grasps"] == 3
    printed = capsys.readouterr().out
    assert "coverage: B has 66.7 % of A" in printed
    assert "precision: A has 100 % of B" in printed


def test_bounds(files: tuple[str, str], tmp_path: Path) -> None:
    def covered(*options: str) -> int:
        comparison = stats(*files, *options, tmp_path=tmp_path)["comparison"]
        count: int = comparison["overall"]["coverage"]["count"]
        return count

    assert covered("--translation-mm", "5") == 1
    assert covered("--translation-mm", "80", "--angle-deg", "0") == 3
    assert covered("--translation-mm", "80", "--distance-mm", "9") == 1


def test_degrees_in_distances(tmp_path: Path) -> None:
    turned = line(0.0).X_OG @ make_pose([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # 90 degrees about x
    GraspSet.create(turned, object="mug").save(tmp_path / "turned.npz")
    line(0.0).save(tmp_path / "straight.npz")
    paths = [str(tmp_path / name) for name in ("straight.npz", "turned.npz")]
    for per_degree, expected in (("1", 0.090), ("0.5", 0.045)):
        figures = stats(*paths, "--mm-per-deg", per_degree, tmp_path=tmp_path)
        assert figures["comparison"]["overall"]["to_grasps"]["mean"] == pytest.approx(expected)


def test_average_precision(
    files: tuple[str, str], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    figures = stats(*files, "--ap", "label", tmp_path=tmp_path)
    first, second = figures["rankings"]
    assert first["average_precision"] == [0.5]
    assert second["average_precision"] == [0.5]
    assert first["top"]["kept"] == 2  # 0 and 10 mm are one
    assert "scores judged by label" in capsys.readouterr().out


def test_a_run_has_its_outcomes(
    run: Run, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    figures = stats(str(run.path), tmp_path=tmp_path)
    outcomes = figures["summaries"][0]["texts"]["outcome"]
    assert sum(outcomes.values()) == 3
    assert outcomes["lifted"] == 1
    assert "outcome: " in capsys.readouterr().out


def test_objects_under_other_names(files: tuple[str, str], tmp_path: Path) -> None:
    line(0.0, object="025_mug").save(tmp_path / "foreign.npz")
    paths = (files[0], str(tmp_path / "foreign.npz"))
    assert stats(*paths, tmp_path=tmp_path)["comparison"]["overall"]["coverage"]["count"] == 0
    renamed = stats(*paths, "--grasps-object", "025_mug=mug", tmp_path=tmp_path)
    assert renamed["comparison"]["overall"]["coverage"]["count"] == 2


def test_a_name_that_no_set_has_is_refused(
    files: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["grasps", "stats", *files, "--rename", "mog=cup"]) == 2
    error = capsys.readouterr().err
    assert "no grasps are of object 'mog'; did you mean 'mug'? Known: mug" in error


def test_collisions_count_as_bad(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(tmp_path / "grasps.h5")
    known = line(0.0, 100.0).with_columns(friction_needed=[0.1, 0.1])
    known.with_columns(clearance=[0.01, -0.01]).save(path)
    (ranking,) = stats(path, "--ap", "friction_needed", tmp_path=tmp_path)["rankings"]
    assert (ranking["good"], ranking["colliding"]) == ([1] * 6, 1)
    assert "\n1 collide, counted as bad.\n" in capsys.readouterr().out
    known.save(path)
    (ranking,) = stats(path, "--ap", "friction_needed", tmp_path=tmp_path)["rankings"]
    assert (ranking["good"], ranking["colliding"]) == ([2] * 6, None)
    assert "Collisions unknown, not counted" in capsys.readouterr().out


def test_names_with_brackets_are_printed_as_they_are(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line(0.0, object="[red]mug").save(tmp_path / "a.npz")
    assert main(["grasps", "stats", str(tmp_path / "a.npz")]) == 0
    assert "[red]mug" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--ap", "lable"], "the grasps have no column 'lable'"),
        (["--ap", "width"], "column 'width' has no values"),
        (["missing.npz"], "missing.npz does not exist"),
    ],
)
def test_one_line_for_an_error(
    files: tuple[str, str],
    options: list[str],
    text: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["grasps", "stats", files[0], *options]) == 2
    captured = capsys.readouterr()
    assert text in captured.err
    assert captured.err.count("\n") == 1
    assert captured.out == ""


def test_frames_do_not_mix(
    files: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "grasps.csv"
    path.write_text("scene_id,qx,qy,qz,qw,x,y,z,width,label\n0,0,0,0,1,0.1,0.1,0.1,0.05,1\n")
    assert main(["grasps", "stats", files[0], str(path)]) == 2
    assert "(object) and" in capsys.readouterr().err
