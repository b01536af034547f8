"""Worker processes."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from burg_drake.core.processes import cause_of_death, default_workers, start_worker

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
    assert cause_of_death(process) == "the worker process ended: exit code 3"
    assert cause_of_death(process, "so be it") == "the worker process ended: so be it"


def test_a_worker_that_is_killed(echo: str) -> None:
    process, _ = start_worker(echo)
    process.kill()
    assert cause_of_death(process) == "the worker process was ended by SIGKILL"


def test_there_is_a_processor() -> None:
    assert default_workers() >= 1
