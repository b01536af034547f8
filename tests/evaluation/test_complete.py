"""What is not judged to the end never looks finished, whoever was to judge it."""

from __future__ import annotations

import re
from collections.abc import Generator, Iterable
from itertools import islice
from pathlib import Path
from typing import Any

import pytest
from asked import asked
from inline_executor import Inline

from burg_drake.apps import main
from burg_drake.core import SimulationError
from burg_drake.evaluation import Job, OnFailure, evaluate
from burg_drake.scene import Scene
from burg_drake.station import Station

OPTIONS = {"grasps_per_object": 5, "blind": True, "progress": False}


class Short(Inline):
    """Ends after two grasps, without a word."""

    def judge(
        self, jobs: Iterable[Job | None], on_failure: OnFailure | None = None
    ) -> Generator[Any, None, None]:
        yield from islice(super().judge(jobs, on_failure), 2)


@pytest.fixture(autouse=True)
def judged_here(known_judge: None) -> None:
    """Without simulation."""


def test_a_run_with_open_grasps_is_an_error(scene: Scene, station: Station, tmp_path: Path) -> None:
    with pytest.raises(SimulationError, match=r"^13 of 15 grasps have no verdict yet"):
        evaluate(scene, station, tmp_path / "run", **asked(executor=Short(), **OPTIONS))
    assert not list((tmp_path / "run").glob("results.*"))
    assert not (tmp_path / "run/report.html").exists()
    run = evaluate(scene, station, tmp_path / "run", **asked(executor=Inline(), **OPTIONS))
    assert run.complete


def test_a_run_with_open_scenes_is_an_error(scene: Scene, station: Station, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    with pytest.raises(SimulationError, match=r"^1 of 1 scenes are not complete"):
        evaluate([scene], station, tmp_path / "runs", **asked(executor=Short(), **OPTIONS))


def test_the_command_does_not_end_as_if_all_were_well(
    scene: Scene,
    station: Station,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    local = "burg_drake.evaluation.cascade.LocalExecutor.of_this_machine"
    monkeypatch.setattr(local, lambda workers: Short())
    call = ["evaluate", "tabletop_six", "-n", "1", "--mode", "hand", "--blind", "--quiet"]
    assert main([*call, "-o", str(tmp_path / "run")]) == 2
    assert re.search(r"\d of \d grasps have no verdict yet", capsys.readouterr().err)
