"""Engines with parallel trials judge grasps of some instances while those of others are sampled."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from asked import asked
from inline_executor import Inline

from burg_drake.core import BurgError, InvalidInputError
from burg_drake.evaluation import (
    EvaluationSettings,
    LocalExecutor,
    Run,
    RunRequest,
    evaluate,
    load_run,
    read_status,
    samples_in_parallel,
)
from burg_drake.scene import Scene
from burg_drake.station import Station
from tests.thorough import thorough

pytest.importorskip("warp")
pytestmark = pytest.mark.usefixtures("known_judge")
SETTINGS = {"grasps_per_object": 5, "blind": True, "mode": "hand"}


def judged(scene: Scene, station: Station, out: Path, engine: str, **options: Any) -> Run:
    executor = options.pop("executor", None) or Inline()
    given = asked(engine=engine, executor=executor, progress=False, **SETTINGS, **options)
    return evaluate(scene, station, out, **given)


@pytest.fixture
def expected(scene: Scene, station: Station, tmp_path: Path) -> Run:
    """The run of an engine that waits until all grasps are sampled."""
    return judged(scene, station, tmp_path / "expected", "mujoco")


@pytest.mark.parametrize("processes", [False, thorough(True)])
def test_grasps_and_verdicts_are_those_of_sampling_first(
    expected: Run, scene: Scene, station: Station, tmp_path: Path, processes: bool
) -> None:
    options = {"executor": LocalExecutor(2), "device": "cpu"} if processes else {}
    run = judged(scene, station, tmp_path / "run", "mujoco-gpu", **options)
    assert run.document.grasps.content == expected.document.grasps.content
    assert run.document.grasps.objects == expected.document.grasps.objects
    assert run.document.grasps.cpu > 0.0
    for name in ("id", "instance", "outcome"):
        assert run.results[name].tolist() == expected.results[name].tolist()
    (session,) = run.document.stretches
    assert (session.judged, session.before) == (15, 0)


def test_a_run_that_is_stopped_while_it_samples_goes_on(
    expected: Run, scene: Scene, station: Station, tmp_path: Path
) -> None:
    out = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        judged(scene, station, out, "mujoco-gpu", executor=Inline(stop=3))
    stopped = load_run(out)
    assert len(stopped.verdicts) == 3
    for ask in (lambda: stopped.complete, lambda: stopped.candidates, lambda: stopped.results):
        with pytest.raises(InvalidInputError, match="not all sampled yet; wait for the process"):
            ask()
    status = read_status(out)
    assert (status.judged, status.total, status.complete) == (3, 15, False)
    executor = Inline()
    run = judged(scene, station, out, "mujoco-gpu", executor=executor)
    assert run.complete
    assert executor.judged == 12
    assert run.document.grasps.content == expected.document.grasps.content
    assert [session.judged for session in run.document.stretches] == [3, 12]
    assert read_status(out).complete


def test_an_instance_that_cannot_be_sampled_loses_no_verdicts(
    expected: Run, scene: Scene, station: Station, tmp_path: Path
) -> None:
    out, mesh = tmp_path / "run", scene.library.path("bar/mesh.obj")
    moved = mesh.rename(mesh.with_suffix(".away"))
    with pytest.raises(BurgError, match=r"mesh\.obj"):
        judged(scene, station, out, "mujoco-gpu")
    assert not load_run(out).is_sampled
    moved.rename(mesh)
    executor = Inline()
    run = judged(scene, station, out, "mujoco-gpu", executor=executor)
    assert executor.judged == 5
    assert run.document.grasps.content == expected.document.grasps.content


@pytest.mark.parametrize("engine", ["mujoco", "mujoco-gpu"])
def test_a_device_that_is_not_there_leaves_no_folder(
    scene: Scene, station: Station, tmp_path: Path, engine: str
) -> None:
    options = {"executor": LocalExecutor(1), "device": "cuda:9"}
    with pytest.raises(InvalidInputError, match="device"):
        judged(scene, station, tmp_path / "run", engine, **options)
    assert not (tmp_path / "run").exists()


def test_grasps_are_sampled_first_where_verdicts_depend_on_all(
    scene: Scene, station: Station
) -> None:
    settings = EvaluationSettings(engine="mujoco-gpu", mode="hand")
    for changes, parallel in (
        ({}, True),
        ({"shard": "1/2"}, False),
        ({"until_balanced": 3}, False),
        ({"only": ("bar",)}, False),
        ({"only": ("cube",)}, True),
        ({"engine": "mujoco"}, False),
    ):
        request = RunRequest.of(station, replace(settings, **changes))
        assert samples_in_parallel(scene, request) is parallel, changes
