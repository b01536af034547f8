"""Worker processes: same verdicts for any number of them, and what happens when they die."""

from __future__ import annotations

import os
import signal
import threading
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from known_judge import (
    CrashingJudge,
    DieOnStart,
    KnownJudge,
    Make,
    ParallelJudge,
    die,
    expected,
    refuse,
)

from burg_drake.core import DeviceError, InvalidInputError, Outcome, SimulationError, Stage
from burg_drake.evaluation import (
    Candidate,
    Job,
    JobFailed,
    LocalExecutor,
    WorkerLimits,
    judge_all,
)


def grasps(n: int) -> list[Candidate]:
    return [Candidate(f"cube-{i:04d}", "cube", np.eye(4)) for i in range(n)]


@pytest.mark.parametrize("workers", [1, 2])
def test_every_grasp_is_judged_once(workers: int) -> None:
    judged = list(judge_all(grasps(50), Make(KnownJudge()), workers=workers))
    assert sorted(c.id for c, _ in judged) == [c.id for c in grasps(50)]
    for candidate, verdict in judged:
        assert verdict.outcome is expected(candidate.id)
        assert verdict.stage is verdict.outcome.stage
        stages = [Stage.CLEAR, Stage.REACHABLE, Stage.EXECUTED]
        assert list(verdict.cpu) == stages[: stages.index(verdict.stage) + 1]


def test_no_grasps_need_no_workers() -> None:
    assert list(judge_all([], die)) == []


def test_deaths_cost_only_the_grasps_that_cause_them() -> None:
    """Three of them in a row, one later."""
    how = {"cube-0002": "segfault", "cube-0003": "segfault"}
    how |= {"cube-0004": "exit", "cube-0017": "error"}
    make = Make(CrashingJudge(how=tuple(how.items())))
    judged = {c.id: v for c, v in judge_all(grasps(30), make, workers=2)}
    assert len(judged) == 30
    failed = {id: v for id, v in judged.items() if v.outcome is Outcome.SIMULATION_FAILED}
    assert {id: v.reason for id, v in failed.items()} == {
        "cube-0002": "the worker process was killed by SIGSEGV",
        "cube-0003": "the worker process was killed by SIGSEGV",
        "cube-0004": "the worker process ended: SystemExit: a condition of Drake failed",
        "cube-0017": "RuntimeError: the solver did not converge",
    }
    assert {v.stage for v in failed.values()} == {Stage.EXECUTED}
    assert not any(v.interrupted for v in failed.values())
    others = {id: v.outcome for id, v in judged.items() if id not in failed}
    assert others == {id: expected(id) for id in judged if id not in failed}


@pytest.mark.thorough
def test_a_death_while_screening_costs_only_the_grasp_that_causes_it() -> None:
    died = "the worker process was killed by SIGSEGV"
    expect = {
        "cube-0003": ("screen", Stage.CLEAR, died),
        "cube-0012": ("screen_error", Stage.CLEAR, "RuntimeError: not a pose"),
        "cube-0015": ("reach", Stage.REACHABLE, died),
        "cube-0016": ("reach_error", Stage.REACHABLE, "RuntimeError: no joint"),
    }
    how = tuple((id, kind) for id, (kind, *_) in expect.items())
    make = Make(CrashingJudge(how=how, batches=(20, 7)))
    judged = {c.id: v for c, v in judge_all(grasps(20), make, workers=1)}
    failed = {id: v for id, v in judged.items() if v.outcome is Outcome.SIMULATION_FAILED}
    assert {id: (v.stage, v.reason) for id, v in failed.items()} == {
        id: told[1:] for id, told in expect.items()
    }
    others = {c.id: expected(c.id) for c in grasps(20) if c.id not in expect}
    assert {id: v.outcome for id, v in judged.items() if id not in expect} == others


def test_of_grasps_that_are_executed_together_a_death_costs_only_its_cause() -> None:
    """The batch goes through the worker in halves, and at last one by one."""
    make = Make(ParallelJudge(how=(("cube-0100", "segfault"),), batches=(512, 512)))
    judged = {c.id: v for c, v in judge_all(grasps(200), make, workers=1)}
    failed = [id for id, v in judged.items() if v.outcome is Outcome.SIMULATION_FAILED]
    assert failed == ["cube-0100"]
    others = {c.id: expected(c.id) for c in grasps(200) if c.id != "cube-0100"}
    assert {id: v.outcome for id, v in judged.items() if id not in failed} == others


def test_a_card_that_fails_decides_nothing_about_grasps(tmp_path: Path) -> None:
    """Another worker judges them."""
    judge = ParallelJudge(log=tmp_path / "failed", how=(("cube-0100", "broken"),))
    judged = {c.id: v.outcome for c, v in judge_all(grasps(200), Make(judge), workers=2)}
    assert (tmp_path / "failed").exists()
    assert judged == {c.id: expected(c.id) for c in grasps(200)}


def test_a_call_ends_with_its_last_card_and_keeps_what_is_judged() -> None:
    bad = [Candidate(f"bad-{i:04d}", "cube", np.eye(4)) for i in range(80)]
    failing = ParallelJudge(how=tuple((grasp.id, "device") for grasp in bad))
    jobs = [Job("good", Make(ParallelJudge()), grasps(20)), Job("bad", Make(failing), bad)]
    judged: list[str] = []
    with pytest.raises(DeviceError, match=r"^device cuda:0 failed$"):
        for _, candidate, verdict in LocalExecutor(1).judge(jobs, failures_are_unexpected):
            assert verdict.outcome is expected(candidate.id)
            judged.append(candidate.id)
    assert sorted(judged) == [c.id for c in grasps(20)]


def failures_are_unexpected(failure: JobFailed) -> None:
    raise AssertionError(failure.job.key)


def test_grasps_are_screened_together_and_once(tmp_path) -> None:
    asked = tmp_path / "asked"
    make = Make(KnownJudge(asked, batches=(7, 5)))
    judged = {c.id: v for c, v in judge_all(grasps(30), make, workers=2)}
    assert sorted(asked.read_text().split()) == [c.id for c in grasps(30)]
    assert {id: v.outcome for id, v in judged.items()} == {c.id: expected(c.id) for c in grasps(30)}
    shares = {v.cpu[Stage.CLEAR] for v in judged.values()}
    assert len(shares) <= 5  # one for each of the screenings: 7, 7, 7, 7 and 2 grasps
    passed = [v.cpu[Stage.REACHABLE] for v in judged.values() if Stage.REACHABLE in v.cpu]
    assert 10 < len(passed) < 30 and len(set(passed)) < len(passed)


def test_a_death_that_does_not_come_again_leaves_no_trace(tmp_path) -> None:
    make = Make(CrashingJudge(log=tmp_path / "crashed", how=(("cube-0002", "once"),)))
    judged = {c.id: v.outcome for c, v in judge_all(grasps(10), make, workers=1)}
    assert (tmp_path / "crashed").exists()
    assert judged == {c.id: expected(c.id) for c in grasps(10)}


@pytest.mark.thorough
def test_deaths_without_end_end_the_run() -> None:
    make = Make(CrashingJudge(how=tuple((c.id, "segfault") for c in grasps(40))))
    judged = []
    with pytest.raises(SimulationError, match=r"^2 grasps in a row could not .*: .*SIGSEGV"):
        for candidate, _ in judge_all(grasps(40), make, workers=2, limits=WorkerLimits(hopeless=2)):
            judged.append(candidate.id)
    assert len(set(judged)) == len(judged) == 2  # none of them is lost


@pytest.mark.thorough
def test_a_replacement_that_dies_while_starting_is_replaced(tmp_path) -> None:
    judge = CrashingJudge(how=(("cube-0002", "segfault"),))
    make = DieOnStart(judge, tmp_path / "twice", n=(2, 4))  # each time after a crash of the grasp
    judged = {c.id: v.outcome for c, v in judge_all(grasps(10), make, workers=1)}
    failed = {"cube-0002": Outcome.SIMULATION_FAILED}
    assert judged == {c.id: expected(c.id) for c in grasps(10)} | failed
    assert len((tmp_path / "twice").read_text().split()) == 5
    make = DieOnStart(judge, tmp_path / "in a row", n=(2, 3))
    with pytest.raises(SimulationError, match=r"cannot build the simulation: .* killed by SIGSEGV"):
        list(judge_all(grasps(10), make, workers=1))


def test_a_grasp_that_takes_too_long_is_settled() -> None:
    # 20 grasps of 50 ms each: a whole task is not a grasp
    judge = CrashingJudge(pause=0.05, how=(("cube-0003", "hang"), ("cube-0012", "spin")))
    limits = WorkerLimits(cpu=0.25, wall=1.5)
    judged = {c.id: v for c, v in judge_all(grasps(20), Make(judge), workers=2, limits=limits)}
    assert len(judged) == 20
    reasons = {
        "cube-0003": "took longer than 1.5 s",
        "cube-0012": "took longer than 0.25 s of CPU time",
    }
    for id, verdict in judged.items():
        if id in reasons:
            assert verdict.outcome is Outcome.SIMULATION_FAILED
            assert verdict.stage is Stage.EXECUTED
            assert verdict.reason == reasons[id]
            assert not verdict.interrupted
        else:
            assert verdict.outcome is expected(id)


@pytest.mark.thorough
def test_a_slow_grasp_is_not_one_that_takes_too_long() -> None:
    judge = KnownJudge(pause=0.6)
    ids = {c.id for c in grasps(20) if expected(c.id).stage is Stage.EXECUTED}
    few = [c for c in grasps(20) if c.id in ids][:2]
    judged = {
        c.id: v for c, v in judge_all(few, Make(judge), workers=2, limits=WorkerLimits(cpu=0.3))
    }
    assert {id: v.outcome for id, v in judged.items()} == {c.id: expected(c.id) for c in few}


def test_what_cannot_be_built_is_said_as_it_is() -> None:
    with pytest.raises(InvalidInputError, match=r"^no such model$"):
        list(judge_all(grasps(3), refuse, workers=1))
    with pytest.raises(SimulationError, match=r"cannot build the simulation: .* killed by SIGSEGV"):
        list(judge_all(grasps(3), die, workers=1))
    with pytest.raises(InvalidInputError, match="workers is 0; give 1 or more"):
        list(judge_all(grasps(3), refuse, workers=0))


def children() -> set[int]:
    threads = Path("/proc/self/task").glob("*/children")
    return {int(p) for thread in threads for p in thread.read_text().split()}


@pytest.mark.skipif(not os.path.exists("/proc/self/task"), reason="looks for children in /proc")
def test_leaving_early_leaves_no_process_behind() -> None:
    before = children()
    with closing(judge_all(grasps(500), Make(KnownJudge(pause=0.01)), workers=2)) as judged:
        next(judged)
        assert len(children() - before) == 2
    assert children() <= before


@pytest.mark.skipif(not os.path.exists("/proc/self/task"), reason="looks for children in /proc")
def test_an_interrupt_reaches_the_caller_alone(capfd: pytest.CaptureFixture[str]) -> None:
    before = children()

    def interrupt() -> None:
        for pid in (*(children() - before), os.getpid()):
            os.kill(pid, signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        for k, _ in enumerate(judge_all(grasps(500), Make(KnownJudge(pause=0.01)), workers=2)):
            if k == 0:
                threading.Timer(0.2, interrupt).start()
        time.sleep(1.0)
    assert children() <= before
    assert "Traceback" not in capfd.readouterr().err
