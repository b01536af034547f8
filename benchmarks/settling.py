"""What settling costs, and how still settled scenes are.

    python benchmarks/settling.py [--scenes N] [--heaps N] [--drift N] [--pairs FOLDER]

Settles scenes of six household objects at random on A3 (`--scenes`), and drops heaps of ten on
A2, on the table and in a bin (`--heaps`), in one process. Prints the CPU time of each, what it went
into, what moves on or rolled away, and what `scene validate` says; then simulates the first
`--drift` of each kind for 5 s by the `reference` engine and prints how far objects moved. Times
mean something on a machine with nothing else to do. `--pairs` settles ten pairs of round or hollow
things in their stead, whose library and scenes it leaves in a folder.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from pathlib import Path

import numpy as np
import trimesh

from burg_drake.core import Pose, inverse
from burg_drake.generation import heap_settling as heaps
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.pipeline import ObjectSource, build_library
from burg_drake.scene import (
    Board,
    Instance,
    LayoutName,
    ObjectShapes,
    Scene,
    SceneDocument,
    arrange,
    choose_objects,
    save_scene,
)
from burg_drake.simulation import measure_drift, settled_scene as settling
from burg_drake.station import SceneCheck, Station, check_scene, load_station
from tools.household import household_shapes
from tools.household.curves import ellipse
from tools.household.solids import circles, hull, hulls, rings_along, sectors, tube, union

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
    parser.add_argument("--pairs", type=Path, metavar="FOLDER", help="settle the ten pairs alone")
    arguments = parser.parse_args()
    if arguments.pairs is not None:
        settle_pairs(arguments.pairs)
        return
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
                moved = measure_drift(settled, station)
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
        wanted = choose_objects(library, count, rng)
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


# Ten pairs of round things in or on hollow things, from parametric shapes.
Body = tuple[trimesh.Trimesh, tuple[trimesh.Trimesh, ...]]
WHITE = (1.0, 1.0, 1.0, 1.0)


def block(size: tuple[float, float, float], x: float = 0.0, y: float = 0.0) -> trimesh.Trimesh:
    """A box on the ground."""
    mesh = trimesh.creation.box(size)
    mesh.apply_translation((x, y, size[2] / 2))
    return mesh


def joined(*parts: trimesh.Trimesh) -> Body:
    """The union of convex parts, and the parts."""
    return union(*((part, WHITE) for part in parts)), parts


def open_box(width: float, depth: float, height: float, wall: float = 0.004) -> Body:
    """A floor and four walls."""
    x, y = (width - wall) / 2, (depth - wall) / 2
    sides = [block((width, wall, height), y=side * y) for side in (-1, 1)]
    ends = [block((wall, depth, height), x=side * x) for side in (-1, 1)]
    return joined(block((width, depth, wall)), *sides, *ends)


def egg_cup() -> Body:
    """A round vessel with a thick floor."""
    radius, inner, height, floor, count = 0.022, 0.019, 0.035, 0.012, 16
    profile = [(0, 0), (radius, 0), (radius, height), (inner, height), (inner, floor), (0, floor)]
    wall = [(radius, 0), (radius, height), (inner, height), (inner, 0)]
    foot = hull(circles([(inner, 0), (inner, floor)], 2 * count))
    return tube(circles(profile, 4 * count)), (*sectors(wall, count), foot)


def egg() -> trimesh.Trimesh:
    """56 mm long, on its thick end."""
    mesh = trimesh.creation.icosphere(subdivisions=3)
    x, y, z = mesh.vertices.T
    slim = 1.0 + 0.12 * z
    mesh.vertices = np.column_stack([0.021 * x / slim, 0.021 * y / slim, 0.028 * z])
    mesh.apply_translation((0.0, 0.0, -mesh.bounds[0, 2]))
    return mesh


def peg() -> Body:
    """A pin on a plate."""
    pin = trimesh.creation.cylinder(radius=0.008, height=0.09, sections=32)
    pin.apply_translation((0.0, 0.0, 0.045))
    return joined(block((0.08, 0.08, 0.012)), pin)


def ring() -> Body:
    """A torus."""
    turn = 2.0 * np.pi * np.arange(48) / 48
    path = 0.025 * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1) + (0.0, 0.0, 0.006)
    rings = rings_along(path, (0, 0, 1), ellipse(0.006, 0.006, 12), closed=True)
    pieces = hulls(np.concatenate([rings, rings[:1]]), range(0, 49, 2))
    return tube(rings, closed=True), pieces


def spoon() -> Body:
    """A shallow oval bowl with a bent handle along +x."""
    oval = (1.4, 1.0, 1.0)
    middle = [(0.0, 0.0), (0.012, 0.0012), (0.012, 0.004), (0.0, 0.0025)]
    edge = [(0.012, 0.0012), (0.018, 0.005), (0.0195, 0.0085), (0.018, 0.0095), (0.012, 0.004)]
    bowl = tube(circles([*middle[:1], *edge, *middle[-1:]], 48)).apply_scale(oval)
    x = np.linspace(0.024, 0.14, 9)
    path = np.column_stack([x, 0.0 * x, 0.008 + 0.012 * np.sin(np.pi * (x - 0.024) / 0.232)])
    grip = rings_along(path, (0, 1, 0), ellipse(0.0015, 0.004, 12), closed=False)
    pieces = [hull(circles(middle, 24) * oval)]
    pieces += [hull(sector.vertices * oval) for sector in sectors(edge, 12)]
    return union((bowl, WHITE), (tube(grip), WHITE)), (*pieces, *hulls(grip, range(0, 9, 2)))


def pair_sources() -> list[ObjectSource]:
    """What the pairs are made of."""
    made = {shape.name: shape for shape in household_shapes()}
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.03)
    ball.apply_translation((0.0, 0.0, 0.03))
    pen = trimesh.creation.cylinder(radius=0.005, height=0.14, sections=32)
    pen.apply_translation((0.0, 0.0, 0.07))
    wall, wedge = block((0.2, 0.03, 0.1)), block((0.05, 0.012, 0.012))
    sources = [
        ObjectSource(name=n, mesh=made[n].mesh, mass=made[n].mass, pieces=made[n].pieces)
        for n in ("mug", "bowl", "marble", "can")
    ]
    sources += [
        ObjectSource(name=name, mesh=mesh, mass=mass)
        for name, mesh, mass in (
            *(("egg", egg(), 0.06), ("pen", pen, 0.012), ("ball", ball, 0.1)),
            *(("wall", wall, 0.6), ("wedge", wedge, 0.05)),
        )
    ]
    bodies: tuple[tuple[str, Body, float], ...] = (
        *(("egg_cup", egg_cup(), 0.05), ("carton", open_box(0.16, 0.12, 0.06), 0.1)),
        *(("peg", peg(), 0.15), ("ring", ring(), 0.03), ("spoon", spoon(), 0.04)),
        ("tray", open_box(0.24, 0.16, 0.02), 0.3),
    )
    sources += [
        ObjectSource(name=name, mesh=mesh, mass=mass, pieces=pieces)
        for name, (mesh, pieces), mass in bodies
    ]
    return sources


def put(
    name: str, x: float, y: float, z: float, *rpy_deg: float, object: str | None = None
) -> Instance:
    """An instance [m, degrees]."""
    roll, pitch, yaw = rpy_deg or (0.0, 0.0, 0.0)
    pose = Pose((x, y, z), rpy_deg=(roll, pitch, yaw))
    return Instance(name=name, object=object or name, X_SO=pose)


PAIRS = {
    "marble in a mug": (put("mug", 0.3, 0.2, 0.0), put("marble", 0.308, 0.197, 0.03)),
    "marble in a bowl": (put("bowl", 0.3, 0.2, 0.0), put("marble", 0.325, 0.21, 0.05)),
    "marble in a tilted bowl": (
        put("wedge", 0.25, 0.2, 0.0, 0.0, 0.0, 90.0),
        put("bowl", 0.3, 0.2, 0.012, 0.0, 8.0, 0.0),
        put("marble", 0.3, 0.2, 0.05),
    ),
    "egg in a cup": (put("egg_cup", 0.3, 0.2, 0.0), put("egg", 0.301, 0.2, 0.03)),
    "can in a box": (put("carton", 0.3, 0.2, 0.0), put("can", 0.3, 0.25, 0.05, 90.0, 0.0, 0.0)),
    "pen in a mug": (put("mug", 0.3, 0.2, 0.0), put("pen", 0.295, 0.2, 0.012, 0.0, 12.0, 0.0)),
    "ball against a wall": (put("wall", 0.3, 0.25, 0.0), put("ball", 0.3, 0.2, 0.0)),
    "ring over a peg": (put("peg", 0.3, 0.2, 0.0), put("ring", 0.302, 0.2, 0.06)),
    "spoon in a bowl": (
        put("bowl", 0.3, 0.2, 0.0),
        put("spoon", 0.3, 0.2, 0.06, 0.0, -25.0, 30.0),
    ),
    "two balls in a tray": (
        put("tray", 0.3, 0.2, 0.0),
        put("one", 0.29, 0.2, 0.01, object="ball"),
        put("other", 0.355, 0.205, 0.01, object="ball"),
    ),
}


def settle_pairs(folder: Path) -> None:
    """Settles the pairs, and prints what came of each."""
    failed = build_library(pair_sources(), folder, confirm=False).failed
    library, station = load_library(folder), load_station("panda_tabletop")
    print(*(f"{name}: {reason}" for name, reason in failed.items()), sep="\n", end="")
    for name, instances in PAIRS.items():
        document = SceneDocument(
            name="pair", library=str(folder), board=Board(size=(0.6, 0.42)), instances=instances
        )
        save_scene(document, folder / f"{name.replace(' ', '_')}.yaml")
        scene = Scene(document, library, folder / "pair.yaml")
        start = time.process_time()
        settled = settling.settle_scene(scene, station)
        cpu = time.process_time() - start
        how = "at rest" if settled.at_rest else f"moves {list(settled.moving)} {settled.fallen}"
        found = [issue.message for issue in check_scene(settled.scene, station)]
        print(f"{name}: {how}, {cpu:.2f} s", *found, sep="; ", flush=True)


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
