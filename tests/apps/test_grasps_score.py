"""`burg-drake grasps score`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps import grasps_score
from burg_drake.apps.cli import main
from burg_drake.core.grasps import GraspSet
from burg_drake.grasping.quality import DEFAULT_METRIC, METRICS

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def grasp_file(tmp_path: Path) -> Path:
    path = tmp_path / "grasps.h5"
    options = ["--object", "can", "--object", "box", "-n", "12", "-o", str(path)]
    assert main(["grasps", "sample", "household", *options]) == 0
    return path


def score(*arguments: str | Path) -> int:
    return main(["grasps", "score", *map(str, arguments)])


def test_columns_a_score_and_a_table(grasp_file: Path, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "scored.npz"
    capsys.readouterr()
    assert score(grasp_file, "--by", "friction_needed", "--friction", "box=0.6", "-o", out) == 0
    scored, before = GraspSet.load(out), GraspSet.load(grasp_file)
    assert set(METRICS) <= set(scored.columns)
    np.testing.assert_array_equal(scored.id, before.id)
    np.testing.assert_array_equal(scored.score, -scored.column("friction_needed"))
    assert scored.provenance["quality"]["payloads"]["box"]["friction"] == 0.6
    text = capsys.readouterr().out
    closed = int(scored.column("force_closure")[scored.object == "can"].sum())
    assert f"can: 12 grasps, {closed} in force closure" in text
    median = np.quantile(scored.column("epsilon")[scored.object == "can"], 0.5, method="nearest")
    rows = [line.split() for line in text.splitlines()]
    assert next(row for row in rows if row[:1] == ["epsilon"])[4] == f"{median:.3g}"
    assert text.splitlines()[-1] == f"wrote 24 grasps to {out}, scored by friction_needed"


def test_nothing_is_written_unasked(grasp_file: Path) -> None:
    before = grasp_file.read_bytes(), sorted(grasp_file.parent.iterdir())
    assert score(grasp_file) == 0
    assert (grasp_file.read_bytes(), sorted(grasp_file.parent.iterdir())) == before


def test_one_line_says_what_is_wrong(grasp_file: Path, capsys: Capture) -> None:
    capsys.readouterr()
    for options, message in (
        (("--by", "epsilom"), "there is no metric 'epsilom'"),
        (("--by", "gravity_margin"), "gravity_margin needs to know where up is; give a scene"),
        (("--friction", "cup=0.3"), "friction is given for 'cup', of which there are no grasps"),
        (("--scene", "tabletop_six"), "has 0 instances of 'can'"),
    ):
        assert score(grasp_file, *options) == 2
        error = capsys.readouterr().err
        assert message in error and error.count("\n") == 1


def test_help_is_in_step_with_the_metrics() -> None:
    assert grasps_score.DEFAULT_METRIC == DEFAULT_METRIC
    assert [*grasps_score.UNITS, "force_closure"] == [*METRICS[1:], "clearance", METRICS[0]]
