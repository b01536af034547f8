"""CoACD in a process of its own: reads a mesh on standard input, writes its convex parts."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]


class DecompositionFailed(Exception):
    """CoACD ended without a result, or did not end in time."""


def run_coacd(
    vertices: _Array, faces: NDArray[np.int64], options: dict[str, Any], timeout: float
) -> tuple[list[_Array], float]:
    """Runs CoACD in a child process.

    Args:
        vertices: (N, 3) vertices [m].
        faces: (F, 3) triangles.
        options: options of `coacd.run_coacd`.
        timeout: CPU time allowed [s].

    Returns:
        The vertices (Ni, 3) of each part, and the child's CPU time [s].

    Raises:
        DecompositionFailed: CoACD crashed, failed, or took too long.
        KeyboardInterrupt: the child was interrupted, as the user interrupts all processes.
    """
    package = io.BytesIO()
    request = json.dumps({"timeout": timeout, "options": options})
    np.savez(package, vertices=vertices, faces=faces, request=request)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    child = subprocess.run(
        [sys.executable, "-P", str(Path(__file__))],
        input=package.getvalue(),
        capture_output=True,
        env=environment,
        check=False,
    )
    if child.returncode == -signal.SIGPROF:
        raise DecompositionFailed(f"it took longer than {timeout:g} s of CPU time")
    if child.returncode in (-signal.SIGINT, -signal.SIGTERM):
        raise KeyboardInterrupt
    if child.returncode != 0:
        output = child.stderr.decode(errors="replace").strip().splitlines() or ["no message"]
        raise DecompositionFailed(f"CoACD ended with code {child.returncode}: {output[-1]}")
    with np.load(io.BytesIO(child.stdout), allow_pickle=False) as result:
        parts = [result[f"part{i}"] for i in range(int(result["count"]))]
        return parts, float(result["seconds"])


def _main() -> None:
    out = os.dup(1)
    os.dup2(2, 1)  # keeps the library's output apart from the result
    import coacd

    with np.load(io.BytesIO(sys.stdin.buffer.read()), allow_pickle=False) as given:
        mesh = coacd.Mesh(given["vertices"], given["faces"].astype(np.int32))
        request = json.loads(str(given["request"]))
    signal.setitimer(signal.ITIMER_PROF, request["timeout"])  # SIGPROF ends the process
    coacd.set_log_level("off")
    parts = coacd.run_coacd(mesh, **request["options"])
    result = io.BytesIO()
    named: dict[str, Any] = {f"part{i}": np.asarray(v) for i, (v, _) in enumerate(parts)}
    np.savez(result, count=len(parts), seconds=time.process_time(), **named)
    with os.fdopen(out, "wb") as stream:
        stream.write(result.getvalue())


if __name__ == "__main__":
    _main()
