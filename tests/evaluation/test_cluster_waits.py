"""Workers of Dask that come late, go, or do not answer; they are threads of this process."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from known_judge import KnownJudge, Make, expected

from burg_drake.core import ClusterError, InvalidInputError, Outcome
from burg_drake.evaluation import Candidate, Job, StationJudgeFactory, WorkerLimits, judge_grasp
from burg_drake.scene import Scene
from burg_drake.simulation import TrialSettings
from burg_drake.station import ENGINES, Station

distributed = pytest.importorskip("distributed", reason="the cluster needs burg-drake[dask]")
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning")

from burg_drake.evaluation import (  # noqa: E402
    ChunkAnswers,
    DaskExecutor,
    Supervisor,
    connect_cluster,
    threads_by_address,
)


@contextlib.contextmanager
def cluster(workers: int = 0) -> Iterator[tuple[Any, Any]]:
    """A cluster and its client."""
    with (
        distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=False, dashboard_address=None
        ) as made,
        distributed.Client(made, set_as_default=False) as client,
    ):
        yield made, client


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Looks often, and judges without children, unless a test wants them."""
    monkeypatch.setattr("burg_drake.evaluation.cluster.dispatch.WORKER_POLL_INTERVAL", 0.1)
    monkeypatch.setattr(Supervisor, "judge", judge_here)


def judge_here(self: Supervisor, job: Job, limits: WorkerLimits) -> ChunkAnswers:
    judge = KnownJudge()
    return ChunkAnswers([(k, judge_grasp(judge, grasp)) for k, grasp in enumerate(job.candidates)])


def grasps(n: int, scene: str = "cube") -> list[Candidate]:
    return [Candidate(f"{scene}-{i:04d}", scene, np.eye(4)) for i in range(n)]


def known(*jobs: Job) -> dict[str, Outcome]:
    return {grasp.id: expected(grasp.id) for job in jobs for grasp in job.candidates}


def found(answers: list[Any]) -> dict[str, Outcome]:
    assert len({grasp.id for _, grasp, _ in answers}) == len(answers)
    return {grasp.id: verdict.outcome for _, grasp, verdict in answers}


def test_workers_that_come_when_there_is_work_are_waited_for() -> None:
    """Of none, Dask starts one because something waits."""
    job = Job("job", Make(KnownJudge()), grasps(20))
    with cluster() as (made, client):
        made.adapt(minimum=0, maximum=1, interval="50ms")
        assert found(list(DaskExecutor(client).judge([job]))) == known(job)


def test_without_work_nobody_is_waited_for() -> None:
    with cluster() as (_, client):
        assert list(DaskExecutor(client).judge([])) == []


def test_workers_that_never_come_are_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("burg_drake.evaluation.cluster.members.WORKER_TIMEOUT", 0.3)
    job = Job("job", Make(KnownJudge()), grasps(3))
    with cluster() as (_, client), pytest.raises(ClusterError, match="has had no worker for"):
        list(DaskExecutor(client).judge([job]))


@pytest.mark.thorough
def test_jobs_that_come_when_all_workers_are_lost_are_judged_later() -> None:
    first, second = (Job(name, Make(KnownJudge()), grasps(3, name)) for name in ("a", "b"))
    answers: list[Any] = []
    lost = threading.Event()

    def jobs() -> Iterator[Job | None]:
        yield first
        while not lost.is_set():
            yield None
        yield second

    with cluster(1) as (made, client):
        alone = 0

        def maintain() -> None:
            nonlocal alone
            alone += lost.is_set()
            if alone == 2:  # one look has seen nobody
                made.scale(1)

        for answer in DaskExecutor(client, maintain=maintain).judge(jobs()):
            answers.append(answer)
            if len(answers) == 3:
                made.scale(0)
                client.sync(made._correct_state)
                assert not threads_by_address(client)
                lost.set()
                time.sleep(0.2)  # so that a look comes before anything is handed out
    assert found(answers) == known(first, second)


def test_grasps_that_are_not_answered_are_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    job, silent = Job("job", Make(KnownJudge()), grasps(12)), "cube-0005"
    asked: list[int] = []

    def judge_some(self: Supervisor, job: Job, limits: WorkerLimits) -> ChunkAnswers:
        """Forgets the last one of several, and always a certain one."""
        answers = judge_here(self, job, limits)
        asked.append(len(job.candidates))
        kept = answers.verdicts[:-1] if len(job.candidates) > 1 else answers.verdicts
        return ChunkAnswers([(k, v) for k, v in kept if job.candidates[k].id != silent])

    monkeypatch.setattr(Supervisor, "judge", judge_some)
    with cluster(1) as (_, client):
        answers = list(DaskExecutor(client).judge([job]))
    assert found(answers) == known(job) | {silent: Outcome.SIMULATION_FAILED}
    verdict = next(v for _, g, v in answers if g.id == silent)
    assert verdict.reason == "3 workers of the cluster gave no answer about it, one after the other"
    assert verdict.interrupted
    assert max(asked) > 1


@pytest.mark.parametrize(
    ("error", "why"),
    [
        (None, "its files are not there afterwards"),
        (RuntimeError("the disk\nis strange"), "RuntimeError: the disk is strange"),
    ],
)
def test_a_scene_that_does_not_arrive_is_told_of(
    error: Exception | None,
    why: str,
    scene: Scene,
    station: Station,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    attempts = []

    def unpack_nothing(data: bytes, place: Path, name: str) -> None:
        attempts.append(name)
        if len(attempts) > 5:
            raise InvalidInputError("it would go on without end")
        if error is not None:
            raise error

    monkeypatch.setattr("burg_drake.evaluation.cluster.worker_tasks.unpack", unpack_nothing)
    factory = StationJudgeFactory(scene, station, ENGINES["standard"], "hand", TrialSettings())
    with cluster(1) as (_, client):
        told = rf"^worker inproc://\S+ did not receive the scene 'job': {why}$"
        with pytest.raises(ClusterError, match=told):
            list(DaskExecutor(client).judge([Job("job", factory, grasps(3))]))
    assert len(attempts) == (1 if error else 3)


@pytest.mark.thorough
def test_who_listens_and_stays_silent_is_no_scheduler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("burg_drake.evaluation.cluster.dask_executor.SCHEDULER_TIMEOUT", 0.3)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with (
            pytest.raises(ClusterError, match="does not answer like a scheduler"),
            connect_cluster(address),
        ):
            pass
