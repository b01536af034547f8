"""How much faster a data set is made by two workers than by one.

    python benchmarks/dataset_scaling.py [--scenes N] [--views N] [--repeats R] [--plain]

Runs come in pairs, one worker and two, first the one and then the other; ratios are of each pair,
and medians are over the pairs. `whole command` is the time of `burg-drake dataset generate` from
its start to its end, with all imports, starts of processes and the card; a single worker is the
command itself, whose renderer has one thread, as workers have. `warm workers` is that of the scenes
alone, by processes that have each made one scene before, also with a single worker. The machine
should do nothing else.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import wait
from dataclasses import replace
from pathlib import Path

from burg_drake.core import Task, WorkerPool
from burg_drake.dataset import (
    AppearanceSettings,
    DatasetRecipe,
    SceneWork,
    make_scene,
)
from burg_drake.scene import load_scene
from burg_drake.station import load_station

SCENES = ("tabletop_six", "tabletop_close")
STATION = "panda_tabletop"
PROGRAM = "from burg_drake.apps.cli import main; raise SystemExit(main())"
TARGET = 1.8


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", type=int, default=8, help="an even number (default: 8)")
    parser.add_argument("--views", type=int, default=10, help="(default: %(default)s)")
    parser.add_argument("--repeats", type=int, default=3, help="pairs (default: %(default)s)")
    parser.add_argument("--plain", action="store_true", help="without varied looks")
    asked = parser.parse_args()
    print(f"{asked.scenes} scenes of {asked.views} views; load of the machine {os.getloadavg()}")
    for name, measure in (("whole command", whole), ("warm workers", warm)):
        compare(name, measure, asked)


def compare(
    name: str, measure: Callable[[int, argparse.Namespace], float], asked: argparse.Namespace
) -> None:
    """Prints the figures of one kind of run."""
    samples = asked.scenes * asked.views
    paces: dict[int, list[float]] = {1: [], 2: []}
    for pair in range(asked.repeats):
        for workers in (1, 2) if pair % 2 == 0 else (2, 1):
            paces[workers].append(samples / measure(workers, asked))
        ratio = paces[2][-1] / paces[1][-1]
        print(
            f"  {name}: {paces[1][-1]:.2f} and {paces[2][-1]:.2f} samples/s, {ratio:.2f}",
            flush=True,
        )
    ratio = statistics.median(b / a for a, b in zip(paces[1], paces[2], strict=True))
    one, two = (statistics.median(paces[workers]) for workers in (1, 2))
    print(
        f"{name}: one worker {one:.2f}, two {two:.2f} samples/s (medians); two are {ratio:.2f}"
        f" times as fast (median of pairs; at least {TARGET} are wanted)",
        flush=True,
    )


def whole(workers: int, asked: argparse.Namespace) -> float:
    """Time of the command [s]."""
    names = [SCENES[k % 2] for k in range(asked.scenes)]
    options = ["--plain"] if asked.plain else []
    with tempfile.TemporaryDirectory() as folder:
        command = ["dataset", "generate", "--scenes", *names, "--views", str(asked.views), *options]
        where = ["--station", STATION, "-o", f"{folder}/data", "--quiet"]
        start = time.perf_counter()
        subprocess.run(
            [sys.executable, "-c", PROGRAM, *command, *where, "--workers", str(workers)],
            check=True,
            stdout=subprocess.DEVNULL,
            env={**os.environ, "LP_NUM_THREADS": "0"},
        )
        return time.perf_counter() - start


def warm(workers: int, asked: argparse.Namespace) -> float:
    """Time of the scenes, by workers that have made one [s]."""
    scenes = [load_scene(SCENES[k % 2]) for k in range(asked.scenes + workers)]
    looks = None if asked.plain else AppearanceSettings()
    recipe = DatasetRecipe(views=asked.views, looks=looks)
    recipe = replace(recipe, given=tuple(scene.content for scene in scenes))
    with tempfile.TemporaryDirectory() as folder, WorkerPool(workers, own_group=True) as pool:
        station = load_station(STATION).path
        tasks = [
            Task(make_scene, (SceneWork(k, scene.path, recipe, Path(folder), station, None),))
            for k, scene in enumerate(scenes)
        ]
        before, timed = tasks[asked.scenes :], tasks[: asked.scenes]
        for k, task in enumerate(before):
            pool.submit_tasks([task], worker=k)[0].result()
        start = time.perf_counter()
        futures = [pool.submit_task(task) for task in timed]
        wait(futures)
        seconds = time.perf_counter() - start
        for future in futures:
            future.result()
        return seconds


if __name__ == "__main__":
    main()
