"""The pool of worker processes: results, errors, deaths, limits, sessions, and how it ends."""

from __future__ import annotations

import gc
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import CancelledError, Executor, as_completed
from functools import partial
from pathlib import Path

import pytest
import worker_jobs as jobs

from burg_drake.core import (
    InvalidInputError,
    Prefetcher,
    Session,
    SimulationError,
    Task,
    TaskCancelled,
    TimeLimit,
    WorkerDied,
    WorkerPool,
    map_unordered,
)
from tests.hang_guard import HANG_GUARD, until


def is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    status = Path(f"/proc/{pid}/stat")
    return not status.exists() or status.read_text().rpartition(")")[2].split()[0] != "Z"


def ends(pid: int) -> bool:
    return until(lambda: not is_alive(pid))


def test_it_is_an_executor() -> None:
    with WorkerPool(2) as pool:
        assert isinstance(pool, Executor)
        assert pool.submit(jobs.square, 3).result(HANG_GUARD) == 9
        assert list(pool.map(jobs.slow, [1, 2, 3, 4], [0.2, 0.0, 0.1, 0.0])) == [1, 2, 3, 4]
        futures = {pool.submit(jobs.square, x): x for x in range(20)}
        assert all(future.result() == futures[future] ** 2 for future in as_completed(futures))
    with pytest.raises(RuntimeError, match="cannot schedule new futures after shutdown"):
        pool.submit(jobs.square, 3)
    assert pool.processes == []


def test_many_small_tasks() -> None:
    with WorkerPool(3) as pool:
        found = list(pool.map(jobs.square, range(2000)))
    assert found == [x * x for x in range(2000)]


def test_no_task_starts_no_process() -> None:
    with WorkerPool(4) as pool:
        assert list(pool.map(jobs.square, [])) == []
        assert pool.submit_tasks([]) == []
        pool.submit(jobs.square, 2).result(HANG_GUARD)
        assert len(pool.processes) == 1
    with pytest.raises(InvalidInputError, match="workers is 0; give 1 or more"):
        WorkerPool(0)


def test_errors_come_as_they_were_raised() -> None:
    with WorkerPool(1) as pool:
        error = pool.submit(jobs.refuse, "this").exception(HANG_GUARD)
        assert isinstance(error, InvalidInputError) and str(error) == "this cannot be used"
        assert "worker_jobs.py" in str(error.__cause__)
        unusual = pool.submit(jobs.raise_unusual).exception(HANG_GUARD)
        assert isinstance(unusual, SimulationError)
        assert str(unusual) == "NeedsTwo: this and that"
        (process,) = pool.processes
        for bad in (
            pool.submit(lambda: None),
            pool.submit(jobs.square, lambda: None),
            pool.submit(jobs.unpicklable_result),
        ):
            assert isinstance(bad.exception(HANG_GUARD), (pickle.PicklingError, AttributeError))
        assert isinstance(pool.submit(jobs.evil_result).exception(HANG_GUARD), ValueError)
        assert pool.submit(jobs.square, 2).result(HANG_GUARD) == 4
        assert pool.processes == [process]


@pytest.mark.parametrize(
    ("number", "outside"),
    [(signal.SIGSEGV, False), (signal.SIGABRT, False), (signal.SIGKILL, True)],
)
def test_a_death_costs_the_task_that_causes_it(number: signal.Signals, outside: bool) -> None:
    with WorkerPool(2) as pool:
        futures = [pool.submit(jobs.square, x) for x in range(10)]
        deadly = pool.submit(jobs.die, number)
        futures += [pool.submit(jobs.square, x) for x in range(10)]
        error = deadly.exception(HANG_GUARD)
        assert isinstance(error, WorkerDied) and error.from_outside is outside
        where = " from outside" if outside else ""
        assert str(error) == f"the worker process was killed{where} by {number.name}"
        assert [f.result(HANG_GUARD) for f in futures] == [x * x for x in range(10)] * 2
        gave_up = pool.submit(jobs.give_up).exception(HANG_GUARD)
        assert str(gave_up) == "the worker process ended: SystemExit: abort: Failure at plant.cc"


def test_who_is_suspect_is_tried_again_alone_in_a_fresh_process(tmp_path: Path) -> None:
    log = tmp_path / "log"
    with WorkerPool(1) as pool:
        futures = pool.submit_tasks([Task(jobs.die_at, (2, x, log)) for x in range(5)])
        assert isinstance(futures[2].exception(HANG_GUARD), WorkerDied)
        assert [f.result(HANG_GUARD) for k, f in enumerate(futures) if k != 2] == [0, 1, 3, 4]
    tried = [line.split() for line in log.read_text().splitlines()]
    assert [x for x, _ in tried] == ["0", "1", "2", "2", "3", "4"]
    processes = [process for _, process in tried]
    assert len(set(processes[:3])) == len(set(processes[4:])) == 1
    assert len(set(processes)) == 3
    with WorkerPool(1) as pool:
        assert pool.submit(jobs.die_once, tmp_path / "once").result(HANG_GUARD) > 0
        once = Task(jobs.die_once, (tmp_path / "never again",), retries=0)
        assert isinstance(pool.submit_task(once).exception(HANG_GUARD), WorkerDied)


@pytest.mark.thorough
def test_a_worker_that_is_ended_by_others_is_replaced() -> None:
    """As the system does when memory runs out: while it is idle, and while it works."""
    with WorkerPool(1) as pool:
        pool.submit(jobs.square, 1).result(HANG_GUARD)
        (idle,) = pool.processes
        os.kill(idle, signal.SIGKILL)
        assert ends(idle)
        while idle in pool.processes:  # a death that the pool has not seen costs a task a try
            time.sleep(0.01)
        future = pool.submit(jobs.slow, 3, 0.5)
        while not (set(pool.processes) - {idle}):
            time.sleep(0.01)
        os.kill(next(iter(set(pool.processes) - {idle})), signal.SIGKILL)
        assert future.result(HANG_GUARD) == 3


class KillsWhenPickled:
    """A number; the worker that is about to be sent it dies."""

    def __init__(self, process: int) -> None:
        self.process = process

    def __reduce__(self) -> tuple[type[int], tuple[int]]:
        os.kill(self.process, signal.SIGKILL)
        os.waitid(os.P_PID, self.process, os.WEXITED | os.WNOWAIT)
        return int, (5,)


@pytest.mark.parametrize("worker", [None, 0])
def test_work_given_to_a_worker_that_has_just_died_is_done(worker: int | None) -> None:
    with WorkerPool(1) as pool:
        pool.submit(jobs.square, 1).result(HANG_GUARD)
        (idle,) = pool.processes
        task = Task(jobs.square, (KillsWhenPickled(idle),), retries=0)
        assert pool.submit_tasks([task], worker)[0].result(HANG_GUARD) == 25
        assert idle not in pool.processes


def test_what_takes_too_long_is_ended_once() -> None:
    with WorkerPool(2) as pool:
        spinning = Task(jobs.spin, limit=TimeLimit(cpu=0.3, wall=30.0))
        hanging = Task(jobs.slow, (1,), limit=TimeLimit(cpu=30.0, wall=0.5))
        errors = [pool.submit_task(task).exception(HANG_GUARD) for task in (spinning, hanging)]
        assert [str(error) for error in errors] == [
            "took longer than 0.3 s of CPU time",
            "took longer than 0.5 s",
        ]
        assert not any(error.from_outside for error in errors if isinstance(error, WorkerDied))
        quick = Task(jobs.slow, (7, 0.6), limit=TimeLimit(cpu=0.5, wall=30.0))
        assert pool.submit_task(quick).result(HANG_GUARD) == 7


def test_sessions_are_built_once_a_worker_and_a_few_are_kept(tmp_path: Path) -> None:
    log = tmp_path / "built"
    a, b, c = (Session(name, partial(jobs.Counter, log, name)) for name in "abc")

    def add(pool: WorkerPool, session: Session) -> tuple[str, int, int]:
        return pool.submit_task(Task(jobs.add, (1,), session=session)).result(HANG_GUARD)

    with WorkerPool(1) as pool:
        assert [add(pool, session)[:2] for session in (a, b, a, b)] == [
            ("a", 1), ("b", 1), ("a", 2), ("b", 2),
        ]  # fmt: skip
        assert pool.sessions(0) == ("a", "b")
        again = Session("a", partial(jobs.Counter, log, "another"))
        assert add(pool, again)[:2] == ("a", 3)
        assert add(pool, c)[0] == "c" and pool.sessions(0) == ("a", "c")
        assert add(pool, b)[:2] == ("b", 1)
        with pytest.raises(InvalidInputError, match="must belong to the same session"):
            pool.submit_tasks([Task(jobs.add, (1,), session=s) for s in (a, b)])
    assert [line.split()[0] for line in log.read_text().splitlines()] == ["a", "b", "c", "b"]
    with WorkerPool(2) as pool:
        tasks = [Task(jobs.add, (1,), session=s) for _ in range(30) for s in (a, b)]
        found = [future.result(HANG_GUARD) for future in [pool.submit_task(t) for t in tasks]]
    assert [name for name, _, _ in found] == ["a", "b"] * 30
    assert len(log.read_text().splitlines()) <= 4 + 4  # not once a task


def test_sessions_that_cannot_be_built(tmp_path: Path) -> None:
    log = tmp_path / "built"
    with WorkerPool(1) as pool:
        refused = Session("refused", jobs.refuse_to_build)
        for _ in range(2):
            task = Task(jobs.add, (1,), session=refused)
            with pytest.raises(InvalidInputError, match="no such scene"):
                pool.submit_task(task).result(HANG_GUARD)
        deadly = Session("deadly", partial(jobs.build_and_die, log), attempts=3)
        futures = [pool.submit_task(Task(jobs.add, (1,), session=deadly)) for _ in range(4)]
        assert {str(f.exception(HANG_GUARD)) for f in futures} == {
            "the worker process was killed by SIGSEGV"
        }
        assert deadly.error is futures[0].exception()
        assert len(log.read_text().split()) == 3
        slow = Session("slow", jobs.spin, limit=TimeLimit(0.2, 30.0), attempts=1)
        error = pool.submit_task(Task(jobs.add, (1,), session=slow)).exception(HANG_GUARD)
        assert str(error) == "took longer than 0.2 s of CPU time"
        assert pool.submit(jobs.square, 2).result(HANG_GUARD) == 4
    with pytest.raises((pickle.PicklingError, AttributeError)):
        Session("unpicklable", lambda: None)


def test_tasks_report_progress() -> None:
    told: list[int] = []
    with WorkerPool(1) as pool:
        task = Task(jobs.count_to, (5,), on_progress=told.append)
        assert pool.submit_task(task).result(HANG_GUARD) == 5
        assert told == [0, 1, 2, 3, 4]
        fails = Task(jobs.count_to, (3,), on_progress=lambda k: 1 // 0)
        assert pool.submit_task(fails).result(HANG_GUARD) == 3
    assert jobs.count_to(3) == 3  # where nobody listens


def test_tasks_that_nobody_waits_for() -> None:
    with WorkerPool(1) as pool:
        begun = threading.Event()
        task = Task(jobs.report_for_ever, on_progress=lambda _: begun.set())
        running, queued = pool.submit_task(task), pool.submit(jobs.square, 2)
        assert begun.wait(HANG_GUARD)
        (process,) = pool.processes
        queued.interrupt()
        with pytest.raises(CancelledError):
            queued.result()
        running.interrupt()
        with pytest.raises(TaskCancelled):
            running.result(HANG_GUARD)
        assert pool.submit(jobs.square, 3).result(HANG_GUARD) == 9
        assert pool.processes == [process]
        hanging = pool.submit(jobs.slow, 1)
        while not hanging.running():
            time.sleep(0.01)
        hanging.terminate()
        with pytest.raises(TaskCancelled):
            hanging.result(HANG_GUARD)
        hanging.terminate()
        assert pool.submit(jobs.square, 4).result(HANG_GUARD) == 16
        assert pool.processes != [process]


def test_shutdown_finishes_or_gives_up_what_waits() -> None:
    pool = WorkerPool(1)
    futures = [pool.submit(jobs.slow, k, 0.1) for k in range(4)]
    pool.shutdown(wait=False)
    assert [future.result(HANG_GUARD) for future in futures] == [0, 1, 2, 3]
    pool = WorkerPool(1)
    futures = [pool.submit(jobs.slow, k, 0.5) for k in range(4)]
    while not futures[0].running():
        time.sleep(0.01)
    pool.shutdown(cancel_futures=True)
    assert futures[0].result() == 0
    assert all(future.cancelled() for future in futures[1:])


def test_ended_workers_end_what_they_were_at() -> None:
    pool = WorkerPool(2)
    futures = [pool.submit(jobs.slow, k) for k in range(4)]
    while len(pool.processes) < 2:
        time.sleep(0.01)
    processes = pool.processes
    pool.kill_workers(HANG_GUARD)
    assert not any(map(is_alive, processes))
    for future in futures:
        assert isinstance(future.exception(HANG_GUARD), TaskCancelled)
    with pytest.raises(ZeroDivisionError), WorkerPool(1) as pool:
        pool.submit(jobs.slow, 1)
        1 // 0  # noqa: B018


def test_an_interrupt_ends_the_pool(capfd: pytest.CaptureFixture[str]) -> None:
    processes: list[int] = []

    def interrupt() -> None:
        processes.extend(pool.processes)
        for pid in (*processes, os.getpid()):
            os.kill(pid, signal.SIGINT)

    with pytest.raises(KeyboardInterrupt), WorkerPool(2) as pool:
        futures = [pool.submit(jobs.slow, k) for k in range(4)]
        while len(pool.processes) < 2:
            time.sleep(0.01)
        threading.Timer(0.5, interrupt).start()
        futures[0].result()
    assert len(processes) == 2 and not any(map(is_alive, processes))
    assert "Traceback" not in capfd.readouterr().err


PARENT = """\
import sys, worker_jobs as jobs
from burg_drake.core import WorkerPool
pool = WorkerPool(2)
futures = [pool.submit(jobs.slow, k) for k in range(2)]
while len(workers := tuple(pool.processes)) < 2:
    pass
print(*workers, flush=True)
futures[0].result()
"""


def test_workers_end_with_a_parent_that_is_killed() -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        [sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True, env=environment
    ) as parent:
        assert parent.stdout is not None
        workers = [int(pid) for pid in parent.stdout.readline().split()]
        parent.kill()
    assert len(workers) == 2 and all(map(ends, workers))


def test_what_a_worker_starts_ends_with_it(tmp_path: Path) -> None:
    pool = WorkerPool(1, own_group=True)
    pool.submit(jobs.start_a_child, tmp_path / "child")
    while not (tmp_path / "child").exists() or not (tmp_path / "child").read_text():
        time.sleep(0.01)
    child = int((tmp_path / "child").read_text())
    pool.kill_workers(HANG_GUARD)
    assert ends(child)


@pytest.mark.parametrize("workers", [1, 2])
def test_unordered_results(workers: int) -> None:
    found = dict(map_unordered(jobs.square, [3, 1, 2], workers))
    assert found == {3: 9, 1: 1, 2: 4}
    ((what, error),) = map_unordered(jobs.refuse, ["this"], workers)
    assert what == "this" and isinstance(error, InvalidInputError)
    for item, _ in (iterator := map_unordered(jobs.square, [1, 2, 3], workers)):
        assert item in (1, 2, 3)
        iterator.close()  # type: ignore[attr-defined]


@pytest.mark.parametrize("workers", [1, 2])
def test_all_work_is_checked_before_any_is_begun(workers: int, tmp_path: Path) -> None:
    """What fails the check is told first, and is not begun."""
    files = [tmp_path / name for name in ("a", "b", "bad", "c", "d")]
    (what, error), *others = map_unordered(jobs.count_checked, files, workers, jobs.check_file)
    assert what.name == "bad" and isinstance(error, InvalidInputError)
    assert dict(others) == {file: 4 for file in files if file.name != "bad"}


def test_results_ahead_come_in_order_and_not_far_ahead() -> None:
    asked: list[int] = []

    def work() -> list[int]:
        for k in range(12):
            asked.append(k)
            yield k  # type: ignore[misc]

    with WorkerPool(2, retries=0) as pool:
        ahead = Prefetcher(
            pool,
            work(),
            lambda k: Task(jobs.die) if k == 5 else Task(jobs.slow, (k, 0.02 * (k % 3))),
        )
        for k in range(12):
            found = ahead.take()
            assert found is not None and found[0] == k
            assert isinstance(found[1], WorkerDied) if k == 5 else found[1] == k
            assert len(asked) <= k + 1 + 4
        assert ahead.ready() and ahead.take() is None
    gc.collect()
