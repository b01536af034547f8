"""Comparing sets of grasps: coverage, nearest grasps, farthest points; rates and exactness.

    python benchmarks/coverage.py [OBJECT] [--reference N] [--grasps M]

Samples antipodal grasps on an object of the household library, and as many scattered ones with any
rotation in its bounding box, and prints CPU time. The peer is BURG-Toolkit, whose `coverage` of
100,000 by 500 grasps takes 3.9 s (k-d trees of positions, then a loop in Python; CPU time of one
core of the same kind of machine), with 15 mm combined and telling the fingers apart. The naive way
is the whole matrix of distances with numpy, a part of the reference at a time, and also the oracle:
every match has to agree. Set OMP_NUM_THREADS=1 and OPENBLAS_NUM_THREADS=1.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import burg_drake as burg
from burg_drake.core import Array, GraspSet, make_pose
from burg_drake.grasping import (
    DISTANCE_LEVER,
    AntipodalSettings,
    coverage,
    farthest_points,
    nearest_grasps,
    neighbour_distances,
    sample_antipodal,
)

PEER_SECONDS = 3.9
"""For 100,000 by 500; for other numbers in proportion to the pairs."""

PEER_DISTANCE = 0.015
REPEATS = 3
PART = 1000


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("object", nargs="?", default="mug")
    parser.add_argument("--reference", type=int, default=100_000)
    parser.add_argument("--grasps", type=int, default=500)
    arguments = parser.parse_args()
    n, m = arguments.reference, arguments.grasps
    print(f"{n:,} by {m:,} grasps; CPU time, best of {REPEATS}")
    for kind, sample in (("antipodal", antipodal), ("scattered", scattered)):
        reference, grasps = sample(arguments.object, n, seed=1), sample(arguments.object, m, seed=2)
        print(f"{kind}, on {arguments.object}")
        measure_coverage(reference, grasps)
        measure_distances(reference, grasps)


def measure_coverage(reference: GraspSet, grasps: GraspSet) -> None:
    """Coverage as the peer defines it, then with our default bounds and twice those."""
    peer = PEER_SECONDS * len(reference) * len(grasps) / (100_000 * 500)
    free = {"translation": math.inf, "angle": math.pi, "distance": PEER_DISTANCE}
    cases = {
        "15 mm combined": free,
        "15 mm, 15 degrees": {},
        "30 mm, 30 degrees": {"translation": 0.03, "angle": math.radians(30.0)},
    }
    for name, bounds in cases.items():
        seconds, result = cpu(lambda bounds=bounds: coverage(reference, grasps, **bounds))
        tolerance = result.tolerance
        slow, near = cpu(lambda t=tolerance: naive_coverage(reference, grasps, t), repeats=1)
        odd = int((near != result.matched).sum())
        print(
            f"  coverage, {name}: {result.overall.value:.1%} in {seconds:.3f} s;"
            f" naive {slow:.2f} s ({slow / seconds:.0f} times), peer {peer:.2f} s"
            f" ({peer / seconds:.0f} times); {odd} judged differently"
        )


def measure_distances(reference: GraspSet, grasps: GraspSet) -> None:
    """Nearest grasps of another set and of the same one, and diverse subsets."""
    seconds, found = cpu(lambda: nearest_grasps(reference, grasps))
    part = reference.select(slice(PART))
    exact = naive_distances(part.X_OG, grasps.X_OG)[2]
    error = np.abs(found.distance[:PART] - exact.min(axis=1)).max()
    rate = len(reference) / seconds
    print(f"  nearest grasps: {seconds:.3f} s, {rate:,.0f} a second; off by {error:.1g} m at most")
    seconds, _ = cpu(lambda: neighbour_distances(reference), repeats=1)
    print(f"  nearest in the set itself: {seconds:.2f} s, {len(reference) / seconds:,.0f} a second")
    for share in (5, 1):
        X_OG = reference.X_OG[::share]
        seconds, _ = cpu(lambda X_OG=X_OG: farthest_points(X_OG, 1000), repeats=1)
        print(f"  1,000 farthest points of {len(X_OG):,}: {seconds:.2f} s")


def naive_coverage(reference: GraspSet, grasps: GraspSet, tolerance: Any) -> Array:
    """By the whole matrix, in parts."""
    near = []
    for k in range(0, len(reference), PART):
        t, a, d = naive_distances(reference.X_OG[k : k + PART], grasps.X_OG)
        fits = (t <= tolerance.translation) & (a <= tolerance.angle) & (d <= tolerance.distance)
        near.append(fits.any(axis=1))
    return np.concatenate(near)


def naive_distances(X_OG: Array, X_OF: Array) -> tuple[Array, Array, Array]:
    """(n, m) translations, angles modulo the swap of the fingers, and both combined."""
    translation = np.linalg.norm(X_OG[:, None, :3, 3] - X_OF[None, :, :3, 3], axis=-1)
    columns = np.einsum("nik,mik->nmk", X_OG[:, :3, :3], X_OF[:, :3, :3])
    trace = np.abs(columns[..., 0] + columns[..., 1]) + columns[..., 2]
    angle = np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0))
    return translation, angle, translation + DISTANCE_LEVER * angle


def antipodal(name: str, n: int, seed: int) -> GraspSet:
    """Antipodal grasps on an object."""
    surface = burg.load_library("household").surface(name)
    return sample_antipodal(
        surface, n, np.random.default_rng(seed), AntipodalSettings(friction=0.5), object=name
    )


def scattered(name: str, n: int, seed: int) -> GraspSet:
    """Any position in the bounding box of an object, any rotation."""
    entry = burg.load_library("household").entry(name)
    rng = np.random.default_rng(seed)
    p = rng.uniform(entry.lower, entry.upper, (n, 3))
    q = rng.normal(size=(n, 4))
    return GraspSet.create(make_pose(Rotation.from_quat(q).as_matrix(), p), object=name)


def cpu(call: Callable[[], Any], repeats: int = REPEATS) -> tuple[float, Any]:
    """CPU time of this process [s], the best of several, and the result."""
    best = math.inf
    for _ in range(repeats):
        start = time.process_time()
        result = call()
        best = min(best, time.process_time() - start)
    return best, result


if __name__ == "__main__":
    main()
