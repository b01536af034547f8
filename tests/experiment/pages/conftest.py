"""Trials of two scenes, and their pictures, made once in each process."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from burg_drake.evaluation import load_runs
from burg_drake.experiment import TrialPictures, TriedRuns
from tests.experiment.pages.tried import make_runs, make_trials


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the runs; tests that change it work on a copy."""
    folder = tmp_path_factory.mktemp("tried")
    with pytest.MonkeyPatch.context() as patch:
        make_trials(folder, make_runs(folder, patch))
    return folder


@pytest.fixture
def trials(made: Path, tmp_path: Path) -> Path:
    """A trials file with its runs, as a copy for one test."""
    shutil.copytree(made, tmp_path / "lab")
    return tmp_path / "lab" / "trials.yaml"


@pytest.fixture(scope="session")
def runs(made: Path) -> TriedRuns:
    """The runs of the trials file."""
    assert load_runs(made / "run_one")
    return TriedRuns(made / "trials.yaml")


@pytest.fixture(scope="session")
def pictures(runs: TriedRuns) -> TrialPictures:
    """Pictures by Drake's renderer."""
    return TrialPictures(runs)
