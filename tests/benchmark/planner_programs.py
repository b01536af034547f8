"""Planners as other people write them: functions, programs and servers without burg_drake."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

import burg_drake
from burg_drake.benchmark import Observation

COPIED = Path(burg_drake.__file__).parent / "benchmark" / "burg_planner.py"
"""The file that people copy."""

ANSWERS = {
    "X_CG": np.array([np.eye(4), np.full((4, 4), np.nan)]),
    "X_SG": np.zeros((0, 4, 4)),
    "score": np.array([0.1, -np.inf], np.float32),
    "width": np.arange(6, dtype=">f8").reshape(3, 2).T[:, ::2],
    "chosen": np.array([True, False]),
    "counts": np.array([[-(2**63), 2**63 - 1]]),
    "time": 0.1 + 0.2,
    "frame": "größe\n",
    "flag": False,
}
"""Entries whose types and bits have to arrive as they are; some mean nothing."""

PROGRAM = """\
import os, sys, time
import numpy as np
from burg_planner import Observation, run

def plan(observation: Observation) -> dict:
    if observation.target == 1:
        raise ValueError("no object\\nat all")
    if observation.target == 2:
        print("out of memory", file=sys.stderr)
        os._exit(3)
    if observation.target == 3:
        time.sleep(60.0)
    if observation.target == 4:
        return None
    if observation.target == 5:
        time.sleep(0.5)
    if observation.target == 6:
        time.sleep(2.0)
    if observation.target == 7:
        raise ValueError("\\udcff")
    if observation.target == 8:
        sys.exit("enough")
    echo = {f"seen_{k}": np.copy(v) for k, v in observation.arrays().items()}
    observation.depth[:] = 0.0  # a planner may work in place
    return {**echo, "pid": os.getpid(), "modules": " ".join(sys.modules), "width": None,
            "X_CG": np.eye(4)[None]}

if __name__ == "__main__":
    run(plan)
"""
"""Repeats what it is asked; targets choose what goes wrong."""


def observation(target: int = 0) -> Observation:
    """An observation of 6 x 8 pixels."""
    rng = np.random.default_rng(5)
    depth = rng.uniform(0.3, 1.0, (6, 8)).astype(np.float32)
    depth[2, 3] = 0.0
    return Observation(
        id=f"{target:064x}",
        color=rng.integers(0, 256, (6, 8, 3), dtype=np.uint8),
        depth=depth,
        K=np.array([[9.0, 0.0, 3.5], [0.0, 9.0, 2.5], [0.0, 0.0, 1.0]]),
        X_WC=np.diag([1.0, -1.0, -1.0, 1.0]),
        X_WS=np.eye(4),
        bounds=np.array([[0.0, 0.0, 0.0], [0.6, 0.4, 0.4]]),
        hand={"name": "häND", "opening": [0.0, 0.08], "tip": 1.0 / 3.0},
        segmentation=rng.integers(0, 4, (6, 8), dtype=np.uint16),
        target=target,
    )


def same(found: Any, expected: Any) -> bool:
    """Whether two values have the same type, shape and bits."""
    if isinstance(expected, np.ndarray):
        return (
            isinstance(found, np.ndarray)
            and (found.dtype, found.shape) == (expected.dtype, expected.shape)
            and found.tobytes() == expected.tobytes()
        )
    return type(found) is type(expected) and found == expected


def write_program(folder: Path) -> Path:
    """`PROGRAM` with the copied file beside it."""
    shutil.copy(COPIED, folder / "burg_planner.py")
    path = folder / "my_planner.py"
    path.write_text(PROGRAM)
    return path


def command(path: Path) -> list[str]:
    """The command that runs a program, without the variables and packages of the user."""
    return [sys.executable, "-E", "-s", str(path)]


@contextmanager
def served(path: Path, port: int = 0) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Runs a program as a server; its address and its process."""
    with subprocess.Popen(
        [*command(path), "--port", str(port)],
        cwd=path.parent,
        stdout=subprocess.PIPE,
        stderr=(path.parent / "stderr.txt").open("a"),
        text=True,
        env={name: value for name, value in os.environ.items() if name != "PYTHONPATH"},
    ) as process:
        assert process.stdout is not None
        try:
            line = process.stdout.readline()
            assert line.startswith("planner my_planner listens on ws://127.0.0.1:"), line
            yield line.split()[-1], process
        finally:
            process.kill()
