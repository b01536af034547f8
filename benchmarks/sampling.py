"""Antipodal grasps per second of CPU time, on mesh files or on the built-in household library.

    python benchmarks/sampling.py [MESH ...] [-n 1000 10000] [--repeat 7] [--options]

Prints for each mesh the rate of one call that samples n grasps: reading of the mesh file is not
included, building of the ray hierarchy is. The ratio, of the first n, is to BURG-Toolkit's dev
branch on the same kind of machine (one core): box 1957, cylinder 1636, mug 1423, screwdriver 344,
sugar box 97 grasps per second. A mesh of another kind is compared with the fastest of these.

`--options` prints the rates with each option alone. The screen of the hand needs objects of a
library, so that it is measured on household only; it counts the grasps that pass.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from burg_drake.core import Array
from burg_drake.grasping import AntipodalSettings, ApproachCone, sample_antipodal
from burg_drake.objects import load_library

PEER = {"sugar": 97.0, "screwdriver": 344.0, "mug": 1423.0, "can": 1636.0, "cylinder": 1636.0}
PEER_FASTEST = 1957.0
TARGET = 20_000.0

DOWN = ApproachCone((0.0, 0.0, -1.0), np.deg2rad(75.0))
SIDE = ApproachCone((1.0, 0.0, 0.0), np.pi / 2)
OPTIONS: dict[str, dict[str, Any]] = {
    "plain": {},
    "from above": {"approach_cones": (DOWN,)},
    "above, one side": {"approach_cones": (DOWN, SIDE)},
    "4 approaches": {"approaches": 4},
    "3 standoffs": {"standoffs": (0.0, 0.004, -0.004)},
    "weights": {},
    "diverse, of 4 n": {"diverse": 4},
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="*", type=Path, help="mesh files; default: household")
    parser.add_argument("-n", type=int, nargs="+", default=[1000, 10_000], help="grasps per call")
    parser.add_argument("--repeat", type=int, default=7, help="calls; the fastest counts")
    parser.add_argument("--options", action="store_true", help="rates with each option")
    arguments = parser.parse_args()
    meshes = named(arguments.meshes) if arguments.meshes else household()
    if arguments.options:
        screens = {} if arguments.meshes else household_screens()
        print_options(meshes, screens, arguments.n[-1], arguments.repeat)
    else:
        print_rates(meshes, arguments.n, arguments.repeat)


def print_rates(meshes: dict[str, trimesh.Trimesh], counts: list[int], repeat: int) -> None:
    columns = "".join(f"{f'n = {n:,}':>13}" for n in counts)
    print(f"grasps a second\n{'mesh':24}{'faces':>8}{columns}{'peer':>8}{'ratio':>8}")
    slowest = np.inf
    for name, mesh in meshes.items():
        rates = [best_rate(mesh, n, repeat) for n in counts]
        slowest = min(slowest, *rates)
        columns = "".join(f"{rate:13,.0f}" for rate in rates)
        ratio = rates[0] / peer(name)
        print(f"{name:24}{len(mesh.faces):8}{columns}{peer(name):8.0f}{ratio:7.1f}x")
    print(f"slowest {slowest:,.0f} grasps/s; target {TARGET:,.0f}")


def print_options(
    meshes: dict[str, trimesh.Trimesh],
    screens: dict[str, Callable[[Array], Array]],
    n: int,
    repeat: int,
) -> None:
    names = [*OPTIONS, *(["clear"] if screens else [])]
    print(f"grasps a second, n = {n:,}\n{'mesh':24}" + "".join(f"{name:>17}" for name in names))
    for name, mesh in meshes.items():
        options = {key: dict(values) for key, values in OPTIONS.items()}
        options["weights"]["weights"] = np.linspace(0.0, 1.0, len(mesh.faces))
        if name in screens:
            options["clear"] = {"accept": screens[name]}
        rates = [best_rate(mesh, n, repeat, **values) for values in options.values()]
        print(f"{name:24}" + "".join(f"{rate:17,.0f}" for rate in rates))


def best_rate(mesh: trimesh.Trimesh, n: int, repeat: int, **options: Any) -> float:
    """The best rate [1/s of CPU time] over seeds."""
    sample_antipodal(mesh, 1, np.random.default_rng(0))
    others = {name: options.pop(name) for name in ("weights", "accept") if name in options}
    settings = AntipodalSettings(**options)
    rates = []
    for seed in range(repeat):
        fresh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)  # nothing cached
        start = time.process_time()
        grasps = sample_antipodal(fresh, n, np.random.default_rng(seed), settings, **others)
        rates.append(len(grasps) / (time.process_time() - start))
    return max(rates)


def peer(name: str) -> float:
    """BURG-Toolkit's rate for this kind of object [1/s]."""
    return next((rate for kind, rate in PEER.items() if kind in name), PEER_FASTEST)


def named(paths: list[Path]) -> dict[str, trimesh.Trimesh]:
    return {path.stem: trimesh.load_mesh(path) for path in paths}


def household() -> dict[str, trimesh.Trimesh]:
    library = load_library("household")
    return {name: library.surface(name) for name in library.objects}


def household_screens() -> dict[str, Callable[[Array], Array]]:
    """For each object, which grasps the Panda's open hand can take of the object alone."""
    from burg_drake.grasping import hand_clearance_alone
    from burg_drake.station import load_station

    library, station = load_library("household"), load_station("panda_tabletop")

    def clear(name: str) -> Callable[[Array], Array]:
        screen = hand_clearance_alone(library, name, station)
        return lambda X_OG: screen.measure(name, X_OG).clear

    return {name: clear(name) for name in library.objects}


if __name__ == "__main__":
    main()
