"""Many jobs through the same worker processes: who builds what, and what becomes of bad jobs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from known_judge import (
    CrashingJudge,
    KnownJudge,
    Make,
    MakeAndTell,
    ParallelJudge,
    die,
    expected,
    number,
    refuse,
)

from burg_drake.core import ONE_BY_ONE, DeviceError, InvalidInputError, Outcome
from burg_drake.evaluation import (
    Candidate,
    Job,
    JobFailed,
    LocalExecutor,
    StationJudgeFactory,
    WorkerLimits,
    keep_workers,
)
from burg_drake.station import ENGINES

cluster_jobs = pytest.importorskip("burg_drake.evaluation.cluster.jobs")


def grasps(scene: str, n: int) -> list[Candidate]:
    return [Candidate(f"{scene}-{i:04d}", scene, np.eye(4)) for i in range(n)]


@pytest.mark.parametrize("workers", [1, 2])
def test_jobs_share_the_processes_and_each_judge_is_built_once(
    workers: int, tmp_path: Path
) -> None:
    log = tmp_path / "built"
    jobs = [
        Job(name, MakeAndTell(KnownJudge(batches=(7, 5)), log, name), grasps(name, n))
        for name, n in (("a", 3), ("b", 9), ("empty", 0), ("c", 1), ("d", 4))
    ]
    judged = list(LocalExecutor(workers).judge(iter(jobs)))
    assert all(verdict.outcome is expected(grasp.id) for _, grasp, verdict in judged)
    assert Counter(job.key for job, _, _ in judged) == {"a": 3, "b": 9, "c": 1, "d": 4}
    assert all(grasp in job.candidates for job, grasp, _ in judged)
    built = [line.split() for line in log.read_text().splitlines()]
    if workers == 1:
        assert [name for name, _ in built] == ["a", "b", "c", "d"]
    assert len({process for _, process in built}) == workers


@pytest.mark.parametrize("kept", [False, True])
def test_processes_stay_for_the_next_call_where_they_are_kept(tmp_path: Path, kept: bool) -> None:
    log, executor = tmp_path / "built", LocalExecutor(1)
    with keep_workers(executor) if kept else nullcontext(executor) as executor:
        for name in ("a", "b", "a"):
            job = Job(name, MakeAndTell(KnownJudge(), log, name), grasps(name, 3))
            assert len(list(executor.judge([job]))) == 3
    built = [line.split() for line in log.read_text().splitlines()]
    assert [name for name, _ in built] == (["a", "b"] if kept else ["a", "b", "a"])
    assert len({process for _, process in built}) == (1 if kept else 3)


def test_a_job_that_becomes_ready_does_not_wait_for_another() -> None:
    asked: list[str] = []

    def jobs() -> Iterator[Job | None]:
        for name in ("slow", "", "", "late"):
            asked.append(name)
            judge = KnownJudge(pause=2.0 if name == "slow" else 0.0)
            yield Job(name, Make(judge), grasps(name, 1)) if name else None

    judged = LocalExecutor(2).judge(jobs())
    next(judged)
    assert asked == ["slow", "", "", "late"]
    judged.close()


def test_jobs_are_asked_for_when_they_are_needed() -> None:
    asked: list[str] = []

    def jobs() -> Iterator[Job]:
        for name in "abcdef":
            asked.append(name)
            yield Job(name, Make(KnownJudge()), grasps(name, 5))

    judged = LocalExecutor(1).judge(jobs())
    for name in "abc":
        for k in range(5):
            assert next(judged)[0].key == name
            assert asked[-1] == name, k
    judged.close()
    assert asked == list("abc")


@pytest.mark.thorough
def test_a_job_that_cannot_be_done_does_not_end_the_others() -> None:
    crashing = CrashingJudge(how=tuple((c.id, "segfault") for c in grasps("worse", 4)))
    jobs = [
        Job("good", Make(KnownJudge()), grasps("good", 6)),
        Job("bad", refuse, grasps("bad", 6)),
        Job("deadly", die, grasps("deadly", 6)),
        Job("worse", Make(crashing), grasps("worse", 4)),
        Job("fine", Make(KnownJudge()), grasps("fine", 6)),
    ]
    failed: list[JobFailed] = []
    executor = LocalExecutor(2, WorkerLimits(hopeless=2))
    judged = list(executor.judge(jobs, failed.append))
    whole = {g.id: expected(g.id) for name in ("good", "fine") for g in grasps(name, 6)}
    found = {grasp.id: verdict.outcome for job, grasp, verdict in judged}
    assert {id: outcome for id, outcome in found.items() if not id.startswith("worse")} == whole
    lost = [outcome for id, outcome in found.items() if id.startswith("worse")]
    assert set(lost) == {Outcome.SIMULATION_FAILED}
    assert len(lost) == 2
    assert {failure.job.key: str(failure.error) for failure in failed} == {
        "bad": "no such model",
        "deadly": "cannot build the simulation: the worker process was killed by SIGSEGV",
        "worse": "2 grasps in a row could not be simulated; the reason of the last one:"
        " the worker process was killed by SIGSEGV",
    }
    with pytest.raises(InvalidInputError, match="no such model"):
        list(LocalExecutor(1).judge(jobs[1:2]))


@pytest.mark.thorough
def test_workers_that_have_no_job_left_help_with_one(tmp_path: Path) -> None:
    log = tmp_path / "built"
    jobs = [
        Job(name, MakeAndTell(KnownJudge(pause=0.02), log, name), grasps(name, n))
        for name, n in (("long", 60), ("short", 2))
    ]
    judged = list(LocalExecutor(2).judge(jobs))
    assert len(judged) == 62
    built = [line.split() for line in log.read_text().splitlines()]
    assert Counter(name for name, _ in built) == {"long": 2, "short": 1}
    assert len({process for _, process in built}) == 2


def test_workers_with_a_card_get_many_grasps_and_halves_of_lost_ones(scene, station) -> None:
    factory = StationJudgeFactory(scene, station, ENGINES["mujoco-gpu"], "hand")
    candidates = grasps("a", 40_000)
    job = cluster_jobs.GraspJob(Job("a", factory, candidates), WorkerLimits(), None)
    lost = job.take_chunk(2)
    assert len(lost.items) == 4096
    assert not list(job.retry_alone(lost))
    assert job.unsent_count == len(candidates)
    first = job.take_chunk(2)
    job.take_back(first)  # it was not begun
    assert job.take_chunk(2).items == first.items
    second = job.take_chunk(2)
    assert (*first.items, *second.items) == lost.items
    assert len(job.take_chunk(1000).items) == 512  # a card takes as long for fewer
    alone = cluster_jobs.SentChunk(job, first.items[:1], losses=2)
    ((_, grasp, verdict),) = job.retry_alone(alone)
    assert grasp is first.items[0] and verdict.outcome is Outcome.SIMULATION_FAILED


def test_workers_without_one_get_few_and_lost_ones_alone(scene, station) -> None:
    factory = StationJudgeFactory(scene, station, ENGINES["mujoco"], "hand")
    job = cluster_jobs.GraspJob(Job("a", factory, grasps("a", 100)), WorkerLimits(), None)
    lost = job.take_chunk(1)
    assert len(lost.items) == 32
    assert not list(job.retry_alone(lost))
    assert [len(job.take_chunk(1).items) for _ in range(33)] == [*[1] * 32, 32]


def test_verdicts_from_a_cluster_name_the_device_of_their_worker() -> None:
    tasks = pytest.importorskip("burg_drake.evaluation.cluster.worker_tasks")
    children = tasks.Supervisor("run")
    children.setup(None)
    judge = ParallelJudge(devices=("NVIDIA H100", ONE_BY_ONE))
    sent = Job("a", Make(judge), grasps("a", 40))
    answer = children.judge(sent, WorkerLimits())
    children.teardown(None)
    for place, verdict in answer.verdicts:
        assert verdict.device == judge.devices[number(sent.candidates[place].id) % 2]
    assert {verdict.device for _, verdict in answer.verdicts} == {*judge.devices}


def test_a_card_that_fails_on_a_cluster_fails_the_job_and_decides_nothing() -> None:
    """A child judges in the process of its Dask worker."""
    tasks = pytest.importorskip("burg_drake.evaluation.cluster.worker_tasks")
    children = tasks.Supervisor("run")
    children.setup(None)
    judge = ParallelJudge(how=(("a-0001", "device"),))
    sent = Job("a", Make(judge), grasps("a", 3))
    answer = children.judge(sent, WorkerLimits())
    children.teardown(None)
    assert isinstance(answer.error, DeviceError) and not answer.verdicts
    assert str(answer.error).startswith("device cuda:0 failed, on ")
