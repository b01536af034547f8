"""The cost of a trial grows with what moves near the hand, not with the scene.

    python benchmarks/crowding.py [SCENE ...] [--trials N] [--engine NAME]
    python benchmarks/crowding.py --scaling [--grasps N]

Executes the same grasps on an object alone, among the five others of its scene, and among eleven;
each with objects locked until they are touched, and with all free from the start. Prints CPU times,
and compares the verdicts of locked and free, every difference with its margins. Free objects creep
and rattle a little, so that bits differ, but not what becomes of a grasp.

`--scaling` prints the wall time of `evaluate` with one and with two workers, and of two threads
that step diagrams of their own. It means something on a machine with nothing else to do.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import tempfile
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from mixed_grasps import clear_grasps, frictions, hand_only

import burg_drake as burg
from burg_drake.core import Array, Pose, Stage, make_pose
from burg_drake.scene import Instance, Scene
from burg_drake.simulation import TrialResult
from burg_drake.station import Station, as_engine

SCENES = ("tabletop_six", "tabletop_close")
NEXT_BOARD = 0.44
"""So far beside the six objects stand six more like them, on the same table [m]."""


@dataclass
class Column:
    """One crowd.

    Attributes:
        locked, free: CPU time of each trial [s], with objects locked until touched, and without.
        pairs: results of the two.
    """

    locked: list[float] = field(default_factory=list)
    free: list[float] = field(default_factory=list)
    pairs: list[tuple[str, TrialResult, TrialResult]] = field(default_factory=list)


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=SCENES, metavar="SCENE")
    parser.add_argument("--station", default="panda_tabletop")
    parser.add_argument("--engine", default="standard")
    parser.add_argument("--trials", type=int, default=8, help="for each object")
    parser.add_argument("--scaling", action="store_true", help="measure workers and threads")
    parser.add_argument("--grasps", type=int, default=400, help="for each object, with --scaling")
    arguments = parser.parse_args()
    for name in arguments.scenes:
        scene, station = burg.load_scene(name), burg.load_station(arguments.station)
        if arguments.scaling:
            scaling(scene, hand_only(station), arguments.grasps)
        else:
            crowding(scene, hand_only(station), arguments.engine, arguments.trials)


# --- crowds -------------------------------------------------------------------------------------


def crowding(scene: Scene, station: Station, engine: str, trials: int) -> None:
    """Prints cost and verdicts of each crowd."""
    twelve = with_twelve(scene)
    columns: dict[str, Column] = {"alone": Column(), "of six": Column(), "of twelve": Column()}
    full = {lock: make_trial(twelve, station, engine, lock) for lock in (True, False)}
    six = {lock: make_trial(scene, station, engine, lock) for lock in (True, False)}
    for name in scene.instances:
        alone = {
            lock: make_trial(only(scene, name), station, engine, lock) for lock in (True, False)
        }
        grasps = clear_grasps(full[True], name, trials)
        for crowd, pair in zip(columns, (alone, six, full), strict=True):
            execute(columns[crowd], pair, name, grasps, frictions(scene, name, len(grasps)))
        print(f"{scene.name}: {name}, {len(grasps)} grasps", flush=True)
    base = float(np.sum(columns["alone"].locked))
    for crowd, column in columns.items():
        report(crowd, column, base)


def execute(
    column: Column, pair: dict[bool, burg.HandTrial], name: str, grasps: Array, friction: Array
) -> None:
    """Executes grasps with and without locking."""
    for i, (X_OG, mu) in enumerate(zip(grasps, friction, strict=True)):
        seconds, results = {}, {}
        for lock, trial in pair.items():
            start = time.process_time()
            results[lock] = trial.run(name, X_OG, friction=mu)
            seconds[lock] = time.process_time() - start
        column.locked.append(seconds[True])
        column.free.append(seconds[False])
        column.pairs.append((f"{name} {i}", results[True], results[False]))


def report(crowd: str, column: Column, base: float) -> None:
    """Prints one crowd."""
    locked, free = np.array(column.locked), np.array(column.free)
    same = [one.outcome is other.outcome for _, one, other in column.pairs]
    ratio = np.sum(locked) / base
    print(
        f"  {crowd:10} locked {locked.mean():.3f} s (median {np.median(locked):.3f}), free"
        f" {free.mean():.3f} s; {ratio:.2f} times one object; verdicts alike {sum(same)} of"
        f" {len(same)}"
    )
    for label, one, other in column.pairs:
        if one.outcome is not other.outcome:
            print(f"    {label}: locked {told(one)}; free {told(other)}")
    held = [(a.margins, b.margins) for _, a, b in column.pairs if a.outcome.held and b.outcome.held]
    for field_name, scale, unit in (
        ("slip", 1e3, "mm"), ("tilt", np.rad2deg(1.0), "deg"), ("pad_force", 1.0, "N"),
        ("lift", 1e3, "mm"), ("others_moved", 1e3, "mm"),
    ):  # fmt: skip
        gaps = [abs(getattr(a, field_name) - getattr(b, field_name)) * scale for a, b in held]
        median, worst = np.median(gaps), np.max(gaps)
        print(
            f"    {field_name:12} differs by {median:.4f} {unit} in the median, {worst:.3f} at most"
        )


def told(result: TrialResult) -> str:
    """Outcome and margins in a few words."""
    margins = result.margins
    return (
        f"{result.outcome} (slip {1e3 * margins.slip:.2f} mm, tilt {np.rad2deg(margins.tilt):.2f}"
        f" deg, others {1e3 * margins.others_moved:.2f} mm)"
    )


def make_trial(scene: Scene, station: Station, engine: str, lock: bool) -> burg.HandTrial:
    """Trials of a scene."""
    return burg.HandTrial(scene, station, engine=as_engine(engine), lock=lock)


def only(scene: Scene, name: str) -> Scene:
    """The scene with one of its objects."""
    document = dataclasses.replace(scene.document, instances=(named(scene, name),))
    return dataclasses.replace(scene, document=document)


def with_twelve(scene: Scene) -> Scene:
    """The scene with a second one like it beside it."""
    twice = []
    for name in scene.instances:
        instance = named(scene, name)
        X_SO = make_pose(p_AB=(0.0, NEXT_BOARD, 0.0)) @ scene.X_SO(name)
        moved = Pose.from_matrix(X_SO, quaternion=True)
        twice += [instance, dataclasses.replace(instance, name=f"{name}_2", X_SO=moved)]
    document = dataclasses.replace(scene.document, instances=tuple(twice))
    return dataclasses.replace(scene, document=document)


def named(scene: Scene, name: str) -> Instance:
    """An instance under its own name."""
    return dataclasses.replace(scene.instance(name), name=name)


# --- workers ------------------------------------------------------------------------------------


def scaling(scene: Scene, station: Station, grasps: int) -> None:
    """Prints wall times of one and two workers, and of one and two threads."""
    print(f"{scene.name}: load average {os.getloadavg()[0]:.2f} on {os.cpu_count()} processors")
    seconds = {}
    for workers in (1, 2):
        with tempfile.TemporaryDirectory() as out:
            start = time.monotonic()
            run = burg.evaluate(
                scene,
                station,
                Path(out) / "run",
                settings=burg.EvaluationSettings(grasps_per_object=grasps, mode="hand"),
                workers=workers,
                progress=False,
            )
            seconds[workers] = time.monotonic() - start
            executed = sum(v.outcome.stage is Stage.EXECUTED for v in run.verdicts.values())
        print(f"  {workers} worker(s): {seconds[workers]:.1f} s, {executed} trials", flush=True)
    print(f"  2 workers are {seconds[1] / seconds[2]:.2f} times as fast as 1")
    one, two = (in_threads(scene, station, count) for count in (1, 2))
    print(f"  2 threads are {2 * one / two:.2f} times as fast as 1 (not used; for information)")


def in_threads(scene: Scene, station: Station, count: int) -> float:
    """Wall time of `count` threads that execute the same grasps, each in its own diagram [s]."""
    trials = [make_trial(scene, station, "standard", True) for _ in range(count)]
    name = next(iter(scene.instances))
    grasps = clear_grasps(trials[0], name, 20)

    def work(trial: burg.HandTrial) -> None:
        for X_OG in grasps:
            trial.run(name, X_OG)

    threads = [threading.Thread(target=work, args=(trial,)) for trial in trials]
    start = time.monotonic()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return time.monotonic() - start


if __name__ == "__main__":
    main()
