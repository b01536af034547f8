"""Meshes to sample on, and what tests read off sampled grasps."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.stats import ks_2samp
from trimesh import creation

from burg_drake.core import GraspSet
from burg_drake.grasping import AntipodalSettings, sample_antipodal


def box(x: float, y: float, z: float, center=(0.0, 0.0, 0.0)) -> trimesh.Trimesh:
    mesh = creation.box(extents=(x, y, z))
    mesh.apply_translation(center)
    return mesh


def tube() -> trimesh.Trimesh:
    """A cup's wall: outer diameter 70 mm, wall 5 mm, 90 mm high, open at both ends."""
    return creation.annulus(r_min=0.030, r_max=0.035, height=0.09, sections=256)


def lumpy() -> trimesh.Trimesh:
    """An irregular closed surface of about 50 mm, 1280 faces, concave in places."""
    mesh = creation.icosphere(subdivisions=3, radius=0.028)
    x, y, z = mesh.vertices.T / 0.028
    bumps = 1.0 + 0.12 * np.sin(4 * x) + 0.1 * np.cos(5 * y + 1) * np.sin(3 * z)
    mesh.vertices *= bumps[:, None]
    return mesh


def grasp(mesh, n=2000, seed=0, **parameters) -> GraspSet:
    others = {k: parameters.pop(k) for k in ("weights", "accept", "object") if k in parameters}
    settings = AntipodalSettings(**parameters)
    return sample_antipodal(mesh, n, np.random.default_rng(seed), settings, **others)


def closing(grasps: GraspSet) -> np.ndarray:
    return grasps.X_OG[:, :3, 0]


def center(grasps: GraspSet) -> np.ndarray:
    return grasps.X_OG[:, :3, 3]


def contacts(grasps: GraspSet) -> tuple[np.ndarray, np.ndarray]:
    half = 0.5 * grasps.width[:, None] * closing(grasps)
    return center(grasps) - half, center(grasps) + half


def statistics(grasps: GraspSet) -> dict[str, np.ndarray]:
    """Numbers that do not depend on how the object lies or which finger is which."""
    return {
        "width": grasps.width,
        "score": grasps.score,
        "closing": np.abs(closing(grasps)[:, 2]),
        "approach": grasps.X_OG[:, 2, 2],
        "height": center(grasps)[:, 2],
        "radius": np.hypot(*center(grasps)[:, :2].T),
    }


def assert_same_distribution(a: GraspSet, b: GraspSet) -> None:
    every_third = slice(None, None, 3)  # one ray may give two grasps, which are not independent
    one, two = statistics(a.select(every_third)), statistics(b.select(every_third))
    for name, values in one.items():
        assert ks_2samp(values, two[name]).pvalue > 1e-4, name
