"""Memory of the process that asks, for many grasps in one scene that all are rejected.

    python benchmarks/run_memory.py 100000 300000

Grasps from memory are judged by a stand-in that rejects each one as the screen of the open hand
does; all else is a run as usual: journal, table, report, parts. It prints the highest memory while
grasps are judged and until all is written, and what it grows by with each further grasp, without
the arrays of the grasps themselves.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import burg_drake as burg
from burg_drake.core import Outcome, Stage, Verdict
from burg_drake.evaluation import Candidate, Job, WorkerLimits
from burg_drake.evaluation.executor import OpenJob

SCREEN_BATCH = 512


class RejectingExecutor:
    """Rejects every grasp, in the batches of the hand's screen."""

    workers = 1

    def __init__(self) -> None:
        self.peak = 0.0

    def judge(
        self, jobs: Iterable[Job | None], on_failure: Any = None
    ) -> Generator[tuple[Job, Candidate, Verdict], None, None]:
        """See `Executor.judge`."""
        for job in jobs:
            assert job is not None
            work = OpenJob(job, WorkerLimits())
            work.set_screens((SCREEN_BATCH,))
            while grasps := work.next_work()[0]:
                for candidate, _ in grasps:
                    x = float(candidate.X_OG[0, 3])
                    margins = {"overlap": abs(x), "clearance": -abs(x)}
                    verdict = Verdict(
                        Outcome.COLLISION_TABLE,
                        Stage.CLEAR,
                        blocker="table",
                        margins=margins,
                        cpu={Stage.CLEAR: 2.5e-5},
                    )
                    yield job, candidate, verdict
        self.peak = peak_memory()


def reset_peak() -> None:
    """Forgets the highest memory so far (Linux)."""
    Path("/proc/self/clear_refs").write_text("5")


def peak_memory() -> float:
    """The highest memory of this process since then, in bytes."""
    lines = Path("/proc/self/status").read_text().splitlines()
    (peak,) = [line.split()[1] for line in lines if line.startswith("VmHWM")]
    return 1024.0 * int(peak)


def measure(count: int) -> None:
    """Prints the bytes of the grasps' arrays, peaks while judging and in all, and CPU time."""
    rng = np.random.default_rng(0)
    X_OG = np.tile(np.eye(4), (count, 1, 1))
    X_OG[:, :3, :3] = Rotation.random(count, random_state=1).as_matrix()
    X_OG[:, :3, 3] = rng.normal(0.0, 0.005, (count, 3))
    scene = burg.load_scene("tabletop_six")
    object = next(iter(scene.instances.values())).object
    grasps = burg.GraspSet.create(X_OG, object=object)
    del X_OG
    columns = (grasps.X_OG, grasps.width, grasps.id, grasps.object, grasps.score)
    arrays = sum(a.itemsize if a.strides == (0,) else a.nbytes for a in columns)
    reset_peak()
    executor, begun = RejectingExecutor(), time.process_time()
    settings = burg.EvaluationSettings(mode="hand")
    with tempfile.TemporaryDirectory() as folder:
        burg.evaluate(
            scene,
            "panda_tabletop",
            Path(folder) / "run",
            grasps=grasps,
            settings=settings,
            executor=executor,
            progress=False,
        )
    print(arrays, executor.peak, peak_memory(), time.process_time() - begun)


def main() -> None:
    """Measures each number of grasps in a process of its own."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("counts", type=int, nargs="+", help="numbers of grasps, ascending")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.here:
        measure(arguments.counts[0])
        return
    before: tuple[int, list[float]] | None = None
    print("grasps      judging [MB]  in all [MB]  CPU [s]  bytes a grasp: judging  in all  arrays")
    for count in arguments.counts:
        command = [sys.executable, __file__, "--here", str(count)]
        words = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
        found = [float(word) for word in words[-4:]]
        text = f"{count:10,}  {found[1] / 1e6:12.0f}  {found[2] / 1e6:11.0f}  {found[3]:7.0f}"
        if before is not None:
            more = count - before[0]
            slopes = [(found[k] - before[1][k]) / more for k in (1, 2, 0)]
            text += (
                f"  {slopes[0] - slopes[2]:22.0f}  {slopes[1] - slopes[2]:6.0f}  {slopes[2]:6.0f}"
            )
        print(text, flush=True)
        before = count, found


if __name__ == "__main__":
    main()
