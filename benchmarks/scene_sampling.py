"""How fast scenes are sampled and settled, and how many attempts it takes.

    python -m benchmarks.scene_sampling            # CPU time a scene, by layout
    python -m benchmarks.scene_sampling --still 3  # and how many of so many a layout hold for 5 s
    python -m benchmarks.scene_sampling --pool 40  # scenes a minute with one and two workers

Six objects of the household library on A3; on A2 six far apart, and a heap of ten. BURG-Toolkit's
dev branch on PyBullet, on the same kind of machine: 0.69 s to sample six objects, 0.44 s to settle
them, with 8 of 20 scenes timing out.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from burg_drake.generation import SampledScene, SceneSampler, sample_scenes
from burg_drake.objects import load_library
from burg_drake.scene import LAYOUT_NAMES, Board, LayoutName, SceneRecipe
from burg_drake.simulation import is_still, measure_drift
from burg_drake.station import Station, load_station

A2, A3 = Board(), Board(size=(0.42, 0.297))


def recipe_of(layout: LayoutName) -> SceneRecipe:
    """Six objects on A3; what needs more room gets it."""
    heap, wide = layout == "heap", layout == "wide"
    return SceneRecipe(
        library="household",
        count=10 if heap else 6,
        board=A2 if heap or wide else A3,
        layout=layout,
        seed=1,
    )


def first_scene() -> None:
    """CPU time that only the first scene takes: what it is made of has to be read."""
    print(f"imports {time.process_time():.2f} s")
    library, station = load_library("household"), load_station("panda_tabletop")
    recipe = replace(recipe_of("wide"), settle=False)
    start = time.process_time()
    sampler = SceneSampler(recipe, library, station)
    looked = time.process_time()
    sampler.sample(0)
    first = time.process_time()
    sampler.sample(0)
    again = time.process_time()
    print(
        f"station {looked - start:.2f} s, first scene of wide {first - looked:.2f} s, the same once"
        f" more {again - first:.2f} s"
    )


def by_layout(scenes: int, still: int) -> None:
    """CPU time of one core, median and largest, with and without settling."""
    library, station = load_library("household"), load_station("panda_tabletop")
    print("layout     placed [s]     settled [s]    accepted  attempts  refused")
    for layout in LAYOUT_NAMES:
        times: dict[bool, list[float]] = {}
        for settle in (False, True):
            sampler = SceneSampler(replace(recipe_of(layout), settle=settle), library, station)
            sampler.sample(1000)  # reads the shapes
            times[settle] = []
            found = []
            for number in range(scenes):
                start = time.process_time()
                found.append(sampler.sample(number))
                times[settle].append(time.process_time() - start)
        refused: dict[str, int] = {}
        for one in found:
            for reason, count in one.refused.items():
                refused[reason] = refused.get(reason, 0) + count
        figures = "  ".join(
            f"{np.median(t):5.2f} to {np.max(t):5.2f}" for t in (times[False], times[True])
        )
        accepted = sum(one.accepted for one in found)
        attempts = np.mean([one.attempts for one in found])
        print(f"{layout:9} {figures}  {accepted:3} of {scenes}  {attempts:6.1f}  {refused}")
        hold(found[:still], station)


def hold(found: Sequence[SampledScene], station: Station) -> None:
    """Simulates settled scenes for 5 s by the reference engine."""
    moved = [measure_drift(one.scene, station) for one in found if one.accepted]
    if moved:
        every = [displacement for scene in moved for displacement in scene.values()]
        print(
            f"          {sum(map(is_still, moved))} of {len(moved)} hold;"
            f" at most {1e3 * max(m.distance for m in every):.2f} mm,"
            f" {np.rad2deg(max(m.angle for m in every)):.3f} deg",
            flush=True,
        )


def by_workers(scenes: int) -> None:
    """Scenes a minute of wall time, start of the processes included."""
    library, station = load_library("household"), load_station("panda_tabletop")
    for workers in (1, 2):
        with tempfile.TemporaryDirectory() as folder:
            start = time.monotonic()
            sample_scenes(recipe_of("random"), library, station, folder, scenes, workers=workers)
            print(
                f"{workers} workers: {60 * scenes / (time.monotonic() - start):.0f} scenes a minute"
            )


def main() -> None:
    """Prints the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=20, help="for each layout")
    parser.add_argument("--still", type=int, default=0, help="scenes of each that are simulated")
    parser.add_argument("--pool", type=int, metavar="N", help="so many scenes by worker processes")
    arguments = parser.parse_args()
    if arguments.pool:
        by_workers(arguments.pool)
    else:
        first_scene()
        by_layout(arguments.scenes, arguments.still)


if __name__ == "__main__":
    main()
