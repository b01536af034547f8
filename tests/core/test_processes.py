"""Worker processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from burg_drake.core import default_workers, exit_cause, start_worker, was_ended_from_outside

ECHO = """\
import os
from multiprocessing.connection import Connection

def main(handle):
    connection = Connection(handle)
    while True:
        text = connection.recv()
        if text == "end":
            os._exit(3)
        connection.send((text, os.environ["OMP_NUM_THREADS"], __name__))
"""


@pytest.fixture
def echo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    (tmp_path / "echo_worker.py").write_text(ECHO)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    return "echo_worker"


def test_a_worker_hears_and_answers(echo: str) -> None:
    process, connection = start_worker(echo)
    connection.send("hello")
    assert connection.recv() == ("hello", "1", "echo_worker")
    assert process.pid != os.getpid()
    connection.send("end")
    assert exit_cause(process) == "the worker process ended: exit code 3"
    assert exit_cause(process, "so be it") == "the worker process ended: so be it"


@pytest.mark.parametrize(
    ("number", "outside"),
    [("SIGKILL", True), ("SIGTERM", True), ("SIGSEGV", False), ("SIGABRT", False)],
)
def test_what_ends_a_worker_from_outside(echo: str, number: str, outside: bool) -> None:
    process, _ = start_worker(echo)
    process.send_signal(signal.Signals[number])
    assert was_ended_from_outside(process) is outside
    where = " from outside" if outside else ""
    assert exit_cause(process) == f"the worker process was killed{where} by {number}"


def test_there_is_a_processor() -> None:
    assert default_workers() >= 1


BUSY = """\
import sys
import time

def main(handle):
    print("at work", file=sys.stderr, flush=True)
    time.sleep(60)
    print("left alone", file=sys.stderr, flush=True)
"""
PARENT = """
from burg_drake.core.worker_processes import start_worker
start_worker("busy_worker")[0].wait()
"""


def test_a_worker_at_work_ends_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    (tmp_path / "busy_worker.py").write_text(BUSY)
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT],
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])},
    )
    assert parent.stderr is not None
    assert parent.stderr.readline() == "at work\n"
    parent.kill()
    assert parent.stderr.read() == ""  # to the end of both
    parent.wait()
