"""`burg-drake planner list` and `serve`: what there is, and a planner as a server."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.benchmark import BUILTIN_PLANNERS, REFERENCE_FORMS, burg_planner
from tests.hang_guard import HANG_GUARD

MODULE = """\
import os
import numpy as np

def plan(observation):
    if observation.target == 2:
        os._exit(4)
    return {"X_CG": observation.X_WC[None], "pid": os.getpid()}
"""
Capture = pytest.CaptureFixture[str]


def observation(target: int = 0) -> burg_planner.Observation:
    """An observation of one pixel."""
    return burg_planner.Observation(
        id=f"{target:064x}",
        color=None,
        depth=np.full((1, 1), 0.5, np.float32),
        K=np.eye(3),
        X_WC=np.diag([1.0, -1.0, -1.0, 1.0]),
        X_WS=np.eye(4),
        bounds=np.zeros((2, 3)),
        hand={"name": "hand"},
        target=target,
    )


def test_list_names_planners_and_forms(capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["planner", "list"]) == 0
    out = capsys.readouterr().out
    head, _, *lines = out.splitlines()
    assert head.split() == ["planner", "uses", "grasps"]
    built_in = lines[: lines.index("")]
    assert [line.split()[0] for line in built_in if line[0] != " "] == list(BUILTIN_PLANNERS)
    for form in REFERENCE_FORMS:
        assert all(word in out for word in form.split())
    assert max(map(len, lines)) <= 80


def test_serve_answers_until_ctrl_c(tmp_path: Path) -> None:
    (tmp_path / "own_planners.py").write_text(MODULE)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    command = ["-m", "burg_drake.apps.cli", "planner", "serve", "own_planners:plan"]
    with subprocess.Popen(
        [sys.executable, *command, "--port", str(port)],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stdout is not None and process.stderr is not None
            line = process.stdout.readline()
            assert line == f"planner own_planners:plan listens on ws://127.0.0.1:{port}\n"
            with burg_planner.RemotePlanner(f"ws://127.0.0.1:{port}") as planner:
                assert planner.name == "own_planners:plan"
                answer = planner.plan(observation())
                assert np.array_equal(answer["X_CG"], observation().X_WC[None])
                assert answer["observation"] == observation().id
                with pytest.raises(RuntimeError, match="it crashed; the worker process ended: exi"):
                    planner.plan(observation(2))
                last = planner.plan(observation())
                assert last["pid"] not in (answer["pid"], process.pid)
                process.send_signal(signal.SIGINT)  # while a client is connected
                assert process.wait(HANG_GUARD) == 0
            assert "Traceback" not in process.stderr.read().rpartition("exit code 4")[2]
            with pytest.raises(ProcessLookupError):
                os.kill(last["pid"], 0)
        finally:
            process.kill()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["antipodl"], "planner 'antipodl' is unknown; did you mean 'antipodal'? Known: "),
        (["oracle"], "planner oracle needs the scene, which an observation does not have"),
        (["own_planners:plan", "--host", "192.0.2.1"], "cannot be served on 192.0.2.1: "),
        (["own_planners:plan", "--time-limit", "0"], "--time-limit"),
    ],
)
def test_what_cannot_be_served_is_one_line(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Capture,
) -> None:
    (tmp_path / "own_planners.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    try:
        code = main(["planner", "serve", *arguments])
    except SystemExit as ended:
        code = ended.code
    assert code == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1


def test_a_port_in_use_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    (tmp_path / "own_planners.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert main(["planner", "serve", "own_planners:plan", "--port", port]) == 2
    assert capsys.readouterr().err == (
        f"burg-drake: error: port {port} of 127.0.0.1 is in use; choose another one (--port)\n"
    )
