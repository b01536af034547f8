"""`burg-drake grasps score`."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.core import GraspSet
from burg_drake.evaluation import Run
from burg_drake.grasping import METRICS

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def sampled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sampled") / "grasps.h5"
    options = ["--only", "can", "--only", "box", "-n", "12", "-o", str(path)]
    assert main(["grasps", "sample", "household", *options]) == 0
    return path


@pytest.fixture
def grasp_file(sampled: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(sampled, tmp_path))


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
    assert text.splitlines()[-2:] == ["scored by friction_needed", f"wrote 24 grasps to {out}"]


def test_other_formats(grasp_file: Path, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "out"
    assert score(grasp_file, "-o", out, "--to", "isaac_grasp") == 0
    assert sorted(path.name for path in out.iterdir()) == ["box.yaml", "can.yaml"]
    capsys.readouterr()
    for options, message in (
        ((tmp_path / "x.yaml",), "give the format (--to)"),
        (
            (tmp_path / "x.yaml", "--to", "isaac_grasp"),
            "grasps of one object, and these are of 2 (box, can)",
        ),
        ((tmp_path / "x.csv",), "VGN and GIGA have grasps in the world frame"),
        ((grasp_file / "x.h5",), "cannot write"),
    ):
        assert score(grasp_file, "-o", *options) == 2
        text = capsys.readouterr()
        assert message in text.err and not text.out  # no table: nothing was scored


def test_a_run_and_what_became_of_it(run: Run, tmp_path: Path) -> None:
    out = tmp_path / "scored.h5"
    assert score(run.path, "-o", out) == 0
    scored = GraspSet.load(out)
    assert scored.column("outcome").tolist() == run.results["outcome"].tolist()
    assert np.isfinite(scored.column("gravity_margin")[0])  # the run has a scene


def test_another_hand_is_said(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "wsg.h5"
    options = ["--only", "can", "-n", "3", "--station", "panda_wsg", "-o", str(path)]
    assert main(["grasps", "sample", "household", *options]) == 0
    told = ((), ("--station", "panda_tabletop"), ("--station", "panda_wsg"))
    for station, said in zip(told, (False, True, False), strict=True):
        capsys.readouterr()
        assert score(path, *station) == 0
        note = (
            "note: The grasps were made for hand 'wsg_50'; they are judged as those of hand"
            " 'panda_hand'.\n"
        )
        assert (note in capsys.readouterr().out) == said


def test_a_station_that_is_gone_is_said(grasp_file: Path, tmp_path: Path, capsys: Capture) -> None:
    grasps = GraspSet.load(grasp_file)
    provenance = {**grasps.provenance, "station": str(tmp_path / "gone.yaml")}
    path = tmp_path / "moved.h5"
    GraspSet.create(grasps.X_OG, object=grasps.object, provenance=provenance).save(path)
    assert score(path) == 2
    said = capsys.readouterr().err
    assert "moved.h5 names a station that is not there: " in said and said.endswith(
        "; give --station\n"
    )
    assert score(path, "--station", "panda_tabletop", "--library", "household") == 0


def test_millimetres_are_refused(grasp_file: Path, tmp_path: Path, capsys: Capture) -> None:
    grasps = GraspSet.load(grasp_file)
    X_OG = grasps.X_OG.copy()
    X_OG[:, :3, 3] *= 1000.0
    path = tmp_path / "mm.h5"
    GraspSet.create(X_OG, object=grasps.object, provenance=grasps.provenance).save(path)
    assert score(path) == 2
    assert "are lengths in metres" in capsys.readouterr().err


def test_nothing_is_written_unasked(grasp_file: Path) -> None:
    before = grasp_file.read_bytes(), sorted(grasp_file.parent.iterdir())
    assert score(grasp_file) == 0
    assert (grasp_file.read_bytes(), sorted(grasp_file.parent.iterdir())) == before


def test_one_line_says_what_is_wrong(grasp_file: Path, capsys: Capture) -> None:
    capsys.readouterr()
    for options, message in (
        (("--by", "epsilom"), "there is no metric 'epsilom'"),
        (("--by", "gravity_margin"), "gravity_margin depends on where up is; give a scene"),
        (("--friction", "cup=0.3"), "friction is given for 'cup', but there are no grasps"),
        (("--scene", "tabletop_six"), "has 0 instances of 'can'"),
    ):
        assert score(grasp_file, *options) == 2
        error = capsys.readouterr().err
        assert message in error and error.count("\n") == 1


def test_a_scene_tells_collisions(scene_file: Path, tmp_path: Path, capsys: Capture) -> None:
    grasps, out = tmp_path / "grasps.h5", tmp_path / "scored.h5"
    sampling = ["grasps", "sample", str(scene_file), "--only", "mug", "-n", "20"]
    assert main([*sampling, "-o", str(grasps)]) == 0
    capsys.readouterr()
    assert score(grasps, "-o", out) == 0
    screened = GraspSet.load(out).column("screened").tolist()
    (line,) = (x for x in capsys.readouterr().out.splitlines() if x.startswith("screened: "))
    told = dict(part.split() for part in line.removeprefix("screened: ").split(", "))
    assert told == {name: str(screened.count(name)) for name in set(screened)}
