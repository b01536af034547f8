"""Whether a closed surface passes through itself, by rays that count how often they are inside."""

from __future__ import annotations

import numpy as np
import trimesh

SELF_OVERLAP = 0.003
"""Share of the inside in which a surface counts as passing through itself; creases of sound scans
stay below it."""

RAYS = 1000


def self_overlap(surface: trimesh.Trimesh, seed: int = 0) -> float:
    """Share of the volume inside a surface that it is wound about more than once, or the wrong way:
    of the length of random lines, uniform in position and direction.

    Args:
        surface: closed, wound outward.
        seed: of the lines.
    """
    rng = np.random.default_rng(seed)
    through, _ = trimesh.sample.sample_surface(surface, RAYS, seed=seed)
    direction = rng.normal(size=(RAYS, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    start = through - 1.5 * np.linalg.norm(surface.extents) * direction
    points, ray, face = surface.ray.intersects_location(start, direction, multiple_hits=True)
    depth = np.einsum("ij,ij->i", points - start[ray], direction[ray])
    entering = -np.einsum("ij,ij->i", surface.face_normals[face], direction[ray])
    # a line is drawn once for each point where it meets the surface, the more so the flatter
    density = np.bincount(ray, 1.0 / np.maximum(np.abs(entering), 1e-9), minlength=RAYS)
    order = np.lexsort([depth, ray])
    ray, depth, entering = ray[order], depth[order], np.sign(entering[order])
    sound = np.bincount(ray, entering, minlength=RAYS)[ray] == 0.0  # else it met an edge
    ray, depth, entering = ray[sound], depth[sound], entering[sound]
    inside = np.cumsum(entering)[:-1]
    step = np.where(ray[1:] == ray[:-1], np.diff(depth) / density[ray[1:]], 0.0)
    wrong = step[(inside > 1.5) | (inside < -0.5)].sum()
    return float(wrong / max(step[np.abs(inside) > 0.5].sum(), 1e-300))
