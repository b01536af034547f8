"""What settling costs, and how still settled scenes are.

    python benchmarks/settling.py [--scenes N] [--heaps N] [--drift N]

Settles scenes of six household objects at random on A3 (`--scenes`), and drops heaps of ten on
A2, on the table and in a bin (`--heaps`), in one process. Prints the CPU time of each, what it went
into, what moves on or rolled away, and what `scene validate` says; then simulates the first
`--drift` of each kind for 5 s by the `reference` engine and prints how far objects moved. Times
mean something on a machine with nothing else to do.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from pathlib import Path

import numpy as np

from burg_drake.core.frames import inverse
from burg_drake.generation import heap as heaps
from burg_drake.objects.library.document import ObjectLibrary, load_library
from burg_drake.scene.arrangement.arranging import arrange, choose
from burg_drake.scene.arrangement.object_shapes import ObjectShapes
from burg_drake.scene.document.layout import LayoutName
from burg_drake.scene.document.scene import Board, Scene, SceneDocument
from burg_drake.simulation.rest.still_check import stillness
from burg_drake.simulation.settling import settled_scene as settling
from burg_drake.station.checks.scene_check import SceneCheck
from burg_drake.station.document.station_document import Station, load_station

A2, A3 = Board(size=(0.594, 0.420)), Board(size=(0.420, 0.297))
KINDS: tuple[tuple[str, str, LayoutName, int, Board], ...] = (
    ("six on A3", "panda_tabletop", "random", 6, A3),
    ("heap of ten", "panda_tabletop", "heap", 10, A2),
    ("bin of ten", "panda_bin", "heap", 10, A2),
)
spent: Counter[str] = Counter()


def main() -> None:
    """Prints the figures."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--heaps", type=int, default=4)
    parser.add_argument("--drift", type=int, default=0, help="simulate so many of each kind")
    arguments = parser.parse_args()
    for stage in ("build_station_diagram", "fall", "predict_drift", "relax"):
        setattr(settling, stage, timed(stage, getattr(settling, stage)))
    for stage in ("drop_onto_scene", "build_station_diagram", "predict_drift", "relax"):
        setattr(heaps, stage, timed(stage, getattr(heaps, stage)))
    library = load_library("household")
    shapes = ObjectShapes(library)
    for kind, station_name, layout, count, board in KINDS:
        station = load_station(station_name)
        seeds = range(arguments.scenes if layout == "random" else arguments.heaps)
        times = []
        rested = 0
        drifts: list[tuple[float, float]] = []
        for seed in seeds:
            scene = lay_out(library, shapes, station, layout, count, board, seed)
            settled, rests, cpu = settle(kind, seed, layout, scene, station, shapes)
            times.append(cpu)
            rested += rests
            if seed < arguments.drift:
                moved = stillness(settled, station)
                drifts += [(1e3 * m.distance, np.rad2deg(m.angle)) for m in moved.values()]
                worst = max(moved, key=lambda n: moved[n].angle)
                print(f"  worst in 5 s: {np.max(drifts[-len(moved) :], axis=0).round(3)}, {worst}")
        if times:
            print(
                f"{kind}: median {np.median(times):.2f} s, worst {max(times):.2f} s of CPU time;"
                f" {rested} of {len(times)} came to rest"
            )
        if drifts:
            print(f"{kind}: drift in 5 s of {len(drifts)} objects [mm, deg]:")
            for share in (50, 90, 99, 100):
                print(f"  {share} %: {np.percentile(drifts, share, axis=0).round(3)}")


def lay_out(
    library: ObjectLibrary,
    shapes: ObjectShapes,
    station: Station,
    layout: LayoutName,
    count: int,
    board: Board,
    seed: int,
) -> Scene:
    """A scene from its seed."""
    rng = np.random.default_rng(seed)
    X_SW = inverse(station.document.X_WS.matrix())
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    obstacles = []
    for box in station.document.background.values():
        X_SB = X_SW @ box.X_WB.matrix()
        obstacles.append(corners * box.size @ X_SB[:3, :3].T + X_SB[:3, 3])
    for _ in range(100):  # until there is room for all
        wanted = choose(library, count, rng)
        arranged = arrange(wanted, shapes, board, rng, layout=layout, obstacles=obstacles)
        if not arranged.missing:
            break
    document = SceneDocument(
        name=f"{layout}_{seed}", library="household", board=board, instances=arranged.instances
    )
    return Scene(document, library, Path(f"{layout}_{seed}.yaml"))


def settle(
    kind: str, seed: int, layout: LayoutName, scene: Scene, station: Station, shapes: ObjectShapes
) -> tuple[Scene, bool, float]:
    """Settles a scene and prints what came of it; whether it rests, and the CPU time [s]."""
    check = SceneCheck(station, scene.library)
    check.issues(scene)  # reads the objects' shapes, once a library
    spent.clear()
    start = time.process_time()
    if layout == "heap":
        settled = heaps.settle_heap(scene, station, check, shapes, np.random.default_rng(seed))
        scene, rests = settled.scene, not settled.faulty
        remarks = [f"amiss: {', '.join(settled.faulty)}"] if settled.faulty else []
        what = f"dropped once more {settled.drops} times"
    else:
        settled = settling.settle_scene(scene, station)
        scene, rests = settled.scene, settled.at_rest
        remarks = [f"moves: {', '.join(settled.moving)}"] if settled.moving else []
        remarks += [f"fell: {', '.join(settled.fallen)}"] if settled.fallen else []
        what = f"fell for {settled.duration:.2f} s"
    cpu = time.process_time() - start
    stages = ", ".join(f"{stage} {seconds:.2f}" for stage, seconds in spent.items())
    remarks += [issue.message for issue in check.issues(scene)]
    print(
        f"{kind}, seed {seed}: {len(scene.instances)} objects, {cpu:.2f} s ({stages}), {what}",
        *remarks,
        sep="\n  ",
        flush=True,
    )
    return scene, rests, cpu


def timed(stage: str, function):  # type: ignore[no-untyped-def]
    """A function that adds its CPU time to `spent`."""

    def call(*args, **kwargs):  # type: ignore[no-untyped-def]
        start = time.process_time()
        result = function(*args, **kwargs)
        spent[stage] += time.process_time() - start
        return result

    return call


if __name__ == "__main__":
    main()
