"""What the scheduling of many scenes costs, and how much faster several workers are.

Judges the same scenes with one worker and with more, each in a folder of its own, and compares the
wall time with the CPU time that screens and trials took. Runs on a machine that does nothing else.

    burg-drake scene sample household -n 6 --count 8 -o /tmp/scenes
    python benchmarks/scaling.py /tmp/scenes/scene_*.yaml -n 20 --workers 2 -o /tmp/scaling
"""

from __future__ import annotations

import argparse
import shutil
import time
from pathlib import Path

import numpy as np

from burg_drake.core import CPU_COLUMNS
from burg_drake.evaluation import EvaluationSettings, evaluate, read_results


def main() -> None:
    """Judges, and prints what it took."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("-n", type=int, default=20)
    parser.add_argument("--mode", default="hand", choices=("hand", "reach", "arm"))
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    paces = []
    for workers in (1, arguments.workers):
        folder = arguments.output / f"workers{workers}"
        shutil.rmtree(folder, ignore_errors=True)
        begun = time.perf_counter()
        run = evaluate(
            arguments.scenes,
            "panda_tabletop",
            folder,
            settings=EvaluationSettings(grasps_per_object=arguments.n, mode=arguments.mode),
            workers=workers,
            progress=False,
        )
        wall = time.perf_counter() - begun
        columns = read_results(folder, [*CPU_COLUMNS.values()])
        judging = sum(float(np.nansum(values)) for values in columns.values())
        count = len(columns["cpu_clear"])
        sampling = sum(state.sampling for state in run.states.values())
        idle = 1.0 - judging / (wall * workers)
        paces.append(count / wall)
        print(
            f"{workers} workers: {count} grasps in {wall:.1f} s, {count / wall:.2f}/s; judging"
            f" {judging:.1f} s CPU, sampling {sampling:.1f} s CPU beside; workers without a grasp"
            f" {100 * idle:.1f} % (start, building of judges and scheduling)",
            flush=True,
        )
    print(f"{arguments.workers} workers are {paces[1] / paces[0]:.2f} times as fast as one")


if __name__ == "__main__":
    main()
