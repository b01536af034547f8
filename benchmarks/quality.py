"""Analytic quality of grasps a second of CPU time, against qhull on discretised friction.

    python benchmarks/quality.py [MESH] [-n 10000] [--qhull 40]

Scores antipodal grasps on a mesh (default: a lumpy surface of 20,480 faces) and computes epsilon
and volume of some of them with scipy's ConvexHull in six dimensions as well, for the friction
ellipsoid of each contact as a polytope of 12 and of 42 corners. One core; the errors are relative
to the epsilon of `wrench_reaches`, and to the volume with polytopes of 1,280 faces.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import ConvexHull

from burg_drake.core import Array
from burg_drake.geometry import Surface
from burg_drake.grasping import (
    ANY_WRENCH,
    AntipodalSettings,
    Payload,
    WrenchSpace,
    epsilon_bracket,
    friction_needed,
    grasp_contacts,
    grasp_quality,
    hull_volume,
    sample_antipodal,
    triangulated_ball,
    wrench_reaches,
)

FRICTION = 0.4
TARGET = 5.0
"""CPU time for 10,000 grasps [s]."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("mesh", nargs="?", type=Path, help="mesh file in metres")
    parser.add_argument("-n", type=int, default=10_000, help="grasps (default: %(default)s)")
    parser.add_argument("--qhull", type=int, default=40, help="grasps for qhull (default: 40)")
    parser.add_argument("--repeat", type=int, default=3, help="runs; the best counts")
    arguments = parser.parse_args()
    mesh = lumpy() if arguments.mesh is None else trimesh.load_mesh(arguments.mesh)
    X_OG = sample_antipodal(
        mesh, arguments.n, np.random.default_rng(0), AntipodalSettings(friction=FRICTION)
    ).X_OG
    center = mesh.bounds.mean(axis=0)
    payload = Payload(mass=0.3, center_of_mass=tuple(center), friction=FRICTION)
    print(f"{len(mesh.faces):,} faces, {len(X_OG):,} grasps")
    with_up = min(score(mesh, X_OG, payload, True) for _ in range(arguments.repeat))
    without = min(score(mesh, X_OG, payload, False) for _ in range(arguments.repeat))
    report("all metrics", without, len(X_OG))
    report("and along gravity", with_up, len(X_OG))
    print(f"target {TARGET * len(X_OG) / 10_000:.1f} s")
    compare(wrench_spaces(mesh, X_OG, center), without / len(X_OG), arguments.qhull)


def lumpy() -> trimesh.Trimesh:
    """A closed surface with bumps, 50 to 90 mm across."""
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=0.03)
    x, y, z = mesh.vertices.T / 0.03
    bumps = 1.0 + 0.06 * np.sin(7.0 * x + 1.0) * np.sin(5.0 * y) * np.cos(6.0 * z)
    mesh.vertices = mesh.vertices * bumps[:, None] * (1.0, 0.8, 1.4)
    return mesh


def score(mesh: trimesh.Trimesh, X_OG: Array, payload: Payload, scene: bool) -> float:
    """CPU time of all metrics, reading of the mesh included [s]."""
    fresh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    start = time.process_time()
    grasp_quality(X_OG, Surface.of(fresh), payload, up=(0.0, 0.0, 1.0) if scene else None)
    return time.process_time() - start


def report(what: str, seconds: float, grasps: int) -> None:
    print(f"{what:24}{seconds:8.2f} s{grasps / seconds:12,.0f} grasps/s")


def wrench_spaces(mesh: trimesh.Trimesh, X_OG: Array, center: Array) -> WrenchSpace:
    contacts = grasp_contacts(Surface.of(mesh), X_OG)
    closure = contacts.touching & (friction_needed(contacts) < FRICTION)
    print(f"{closure.mean():.1%} in force closure where grasped")
    length = float(np.linalg.norm(mesh.vertices - center, axis=1).max())
    return WrenchSpace.of(contacts.select(closure), FRICTION, center, length, X_OG[closure, :3, 1])


def compare(space: WrenchSpace, seconds: float, count: int) -> None:
    """Prints errors and times of qhull next to ours."""
    some = space.select(np.linspace(0, len(space) - 1, count).astype(int))
    (epsilon,) = wrench_reaches(some, [ANY_WRENCH])
    lower, _ = epsilon_bracket(some, 2)
    volume = hull_volume(some, triangulated_ball(3, of_volume=True))
    ours = np.abs(hull_volume(some, triangulated_ball(1, of_volume=True)) / volume - 1.0)
    print(f"epsilon at most {np.max(1.0 - lower / epsilon):.1%} above a certain lower bound")
    print(f"volume within {ours.max():.1%}")
    for subdivisions in (0, 1):
        vertices = triangulated_ball(subdivisions).vertices
        start = time.process_time()
        hulls = [hull(basis, vertices) for basis in some.basis]
        each = (time.process_time() - start) / count
        inner = np.array([max(0.0, -h.equations[:, -1].max()) for h in hulls])
        off_epsilon = 1.0 - inner / epsilon
        off_volume = 1.0 - np.array([h.volume for h in hulls]) / volume
        print(
            f"qhull, {len(vertices)} corners a contact: {1e3 * each:.2f} ms a grasp,"
            f" {each / seconds:.1f} times as long as all metrics of ours;"
            f" epsilon too small by {off_epsilon.mean():.1%} (at most {off_epsilon.max():.1%}),"
            f" volume by {off_volume.mean():.1%}"
        )


def hull(basis: Array, vertices: Array) -> ConvexHull:
    sets = [contact[:, 0] + vertices @ contact[:, 1:].T for contact in basis]
    return ConvexHull(np.concatenate(sets))


if __name__ == "__main__":
    main()
