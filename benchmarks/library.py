"""CPU time of building an object library, beside the figures of the PyBullet peer.

    python benchmarks/library.py [MESH ...] [--no-parallel]

Builds the surfaces of the built-in library, cut by CoACD as a user's meshes are, and the meshes
given. Prints a row an object with the time of each stage, then medians beside the peer's figures,
the time of a rebuild of 50 unchanged objects, and how much faster two workers are than one (wall
time: leave the machine alone meanwhile; CoACD's own threads are off, so that a worker is a core).
BURG-Toolkit takes 24 to 65 s to decompose an object with concavities, and 0.04 to 1.75 s for the
stable poses of an object.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from pathlib import Path

import numpy as np
import trimesh

import burg_drake as burg
from burg_drake.core import SINGLE_THREAD_ENVIRONMENT
from burg_drake.pipeline import BuildReport, ObjectSource

STAGES = ("mesh", "pieces", "fit", "mass", "visual", "stable_poses", "confirm")
PEER_DECOMPOSITION = (24.0, 65.0)
PEER_POSES = (0.04, 1.75)
UNCHANGED = 50


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("meshes", nargs="*", help="mesh files in metres")
    parser.add_argument("--no-parallel", action="store_true", help="leave out the two workers")
    arguments = parser.parse_args()
    os.environ.update(SINGLE_THREAD_ENVIRONMENT)
    household = burg.load_library("household")
    sources = [ObjectSource(name=n, mesh=household.surface(n)) for n in household.objects]
    sources += [ObjectSource.from_file(mesh) for mesh in arguments.meshes]
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        report = burg.build_library(sources, Path(folder) / "one")
        alone = time.perf_counter() - start
        print_stages(report)
        print_summary(report)
        warm(Path(folder) / "warm", arguments.meshes)
        if not arguments.no_parallel:
            start = time.perf_counter()
            burg.build_library(sources, Path(folder) / "two", workers=2)
            both = time.perf_counter() - start
            print(
                f"{len(sources)} objects: {alone:.1f} s with one worker, {both:.1f} s with two:"
                f" {alone / both:.2f} times as fast (target 1.8)"
            )


def print_stages(report: BuildReport) -> None:
    """A row an object: CPU seconds by stage, and how well the pieces fit."""
    print(f"{'object':20}" + "".join(f"{stage:>13}" for stage in (*STAGES, "all")), end="")
    print(f"{'pieces':>8}{'volume':>8}{'off [mm]':>9}  poses")
    for name, seconds in report.seconds.items():
        entry = report.library.entry(name)
        row = [seconds.get(stage, 0.0) for stage in STAGES]
        print(f"{name:20}" + "".join(f"{s:13.3f}" for s in (*row, sum(row))), end="")
        ratio, off = (entry.fit.volume_ratio, entry.fit.hausdorff) if entry.fit else (np.nan,) * 2
        print(f"{len(entry.pieces):8}{ratio:8.2f}{1e3 * off:9.1f}  {len(entry.stable_poses)}")
    for name, reason in report.failed.items():
        print(f"{name}: {reason}")


def print_summary(report: BuildReport) -> None:
    """Medians beside targets and the peer."""
    seconds = list(report.seconds.values())
    cutting = np.array([s["pieces"] for s in seconds])
    whole = np.array([sum(s.values()) for s in seconds])
    concave = np.array([len(report.library.entry(n).pieces) > 1 for n in report.seconds])
    poses = np.array([s["stable_poses"] + s.get("confirm", 0.0) for s in seconds])
    confirm = np.array([s.get("confirm", 0.0) for s in seconds])
    print(f"\n{'CPU seconds an object':34}{'median':>8}{'most':>8}  target  peer")
    for label, values, target, peer in (
        ("whole build without decomposition", whole - cutting, "10", ""),
        ("whole build", whole, "15", ""),
        ("decomposition of concave objects", cutting[concave], "", span(PEER_DECOMPOSITION)),
        ("stable poses, simulation included", poses, "", span(PEER_POSES) + ", not simulated"),
        ("simulation of the stable poses", confirm, "1", "none"),
    ):
        print(f"{label:34}{np.median(values):8.2f}{values.max():8.2f}  {target:>6}  {peer}")
    ratio = PEER_DECOMPOSITION[0] / np.median(cutting[concave])
    print(f"decomposition: {ratio:.1f} times as fast as the peer at its best\n")


def span(values: tuple[float, float]) -> str:
    """A range for people."""
    return f"{values[0]:g} to {values[1]:g}"


def warm(folder: Path, meshes: list[str]) -> None:
    """Builds many objects twice, and prints the CPU time of the second time."""
    files = [Path(mesh) for mesh in meshes] or [None]
    sources = []
    for i in range(UNCHANGED):
        file = files[i % len(files)]
        box = trimesh.creation.box((0.05, 0.06, 0.07))
        mesh = box if file is None else file
        sources.append(ObjectSource(name=f"object_{i}", mesh=mesh, pieces=(box,), mass=0.1))
    burg.build_library(sources, folder, confirm=False)
    start = time.process_time()
    cached = burg.build_library(sources, folder, confirm=False).cached
    seconds = time.process_time() - start
    print(f"{len(cached)} unchanged objects: {seconds:.2f} s (target 1)")


if __name__ == "__main__":
    main()
