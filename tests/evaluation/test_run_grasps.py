"""A run as a grasp set: every column of the results, in the order of the candidates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import GraspSet
from burg_drake.evaluation import JOURNAL_FILE, Run, load_run, run_grasps


@pytest.fixture
def run(own_run: Run) -> Run:
    return own_run


def test_columns_of_the_results(run: Run, tmp_path: Path) -> None:
    grasps = run_grasps(run)
    assert grasps.column("instance").tolist() == run.candidates.instance.tolist()
    for name in ("outcome", "stage", "blocker", "slip", "pad_force", "moved_left", "cpu_clear"):
        np.testing.assert_array_equal(grasps.column(name), run.results[name], err_msg=name)
    ids = [f"{i}-{g}" for i, g in zip(grasps.column("instance"), grasps.id, strict=True)]
    assert ids == run.candidates.id
    grasps.save(tmp_path / "all.h5")
    back = GraspSet.load(tmp_path / "all.h5")
    np.testing.assert_array_equal(back.column("outcome"), grasps.column("outcome"))


def test_grasps_that_are_not_judged_yet(run: Run) -> None:
    journal = run.path / JOURNAL_FILE
    lines = journal.read_text().splitlines(keepends=True)
    journal.write_text("".join(lines[:-4]))
    whole, part = run_grasps(run), run_grasps(load_run(run.path))
    assert len(part) == len(whole) == len(lines)
    waiting = part.column("outcome") == ""
    assert waiting.sum() == 4
    assert np.isnan(part.column("overlap")[waiting]).all()
    judged = ~waiting
    assert part.column("outcome")[judged].tolist() == whole.column("outcome")[judged].tolist()


def test_nothing_is_judged_yet(run: Run) -> None:
    (run.path / JOURNAL_FILE).write_text("")
    grasps = run_grasps(load_run(run.path))
    assert set(grasps.column("outcome").tolist()) == {""}
    assert np.isnan(grasps.column("slip")).all()
