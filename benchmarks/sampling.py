"""Antipodal grasps per second of CPU time, on mesh files or on the built-in household library.

    python benchmarks/sampling.py [MESH ...] [-n 1000] [--repeat 5]

Prints for each mesh the rate of one call that samples n grasps, reading of the mesh file not
included, building of the ray hierarchy included, and its ratio to BURG-Toolkit's dev branch on the
same kind of machine (one core): box 1957, cylinder 1636, mug 1423, screwdriver 344, sugar box 97
grasps per second. A mesh of another kind is compared with the fastest of these.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
import trimesh

from burg_drake.grasping.antipodal import sample_antipodal
from burg_drake.objects.library import load_library

PEER = {"sugar": 97.0, "screwdriver": 344.0, "mug": 1423.0, "can": 1636.0, "cylinder": 1636.0}
PEER_FASTEST = 1957.0
TARGET = 2000.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="*", type=Path, help="mesh files; default: household")
    parser.add_argument("-n", type=int, default=1000, help="grasps per call (default 1000)")
    parser.add_argument("--repeat", type=int, default=5, help="calls; the median counts")
    arguments = parser.parse_args()
    print(f"{'mesh':24}{'faces':>8}{'grasps':>8}{'grasps/s':>11}{'peer':>7}{'ratio':>8}")
    slowest = np.inf
    for name, mesh in named(arguments.meshes) if arguments.meshes else household():
        count, rate = measure(mesh, arguments.n, arguments.repeat)
        reference = peer(name)
        slowest = min(slowest, rate)
        print(
            f"{name:24}{len(mesh.faces):8}{count:8}{rate:11,.0f}{reference:7.0f}"
            f"{rate / reference:7.1f}x"
        )
    print(f"slowest {slowest:,.0f} grasps/s; target {TARGET:,.0f}")


def measure(mesh: trimesh.Trimesh, n: int, repeat: int) -> tuple[int, float]:
    """Grasps found, and the median rate [1/s of CPU time] over seeds."""
    sample_antipodal(mesh, 1, np.random.default_rng(0))
    rates = []
    for seed in range(repeat):
        fresh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)  # nothing cached
        start = time.process_time()
        grasps = sample_antipodal(fresh, n, np.random.default_rng(seed))
        rates.append(len(grasps) / (time.process_time() - start))
    return len(grasps), float(np.median(rates))


def peer(name: str) -> float:
    """BURG-Toolkit's rate for this kind of object [1/s]."""
    return next((rate for kind, rate in PEER.items() if kind in name), PEER_FASTEST)


def named(paths: list[Path]) -> list[tuple[str, trimesh.Trimesh]]:
    return [(path.stem, trimesh.load_mesh(path)) for path in paths]


def household() -> list[tuple[str, trimesh.Trimesh]]:
    library = load_library("household")
    return [(name, library.surface(name)) for name in library.objects]


if __name__ == "__main__":
    main()
