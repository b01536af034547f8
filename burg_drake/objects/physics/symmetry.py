"""Whether a turn of an object about its centre of mass takes it onto itself, within a tolerance.

Mirror images do not count: a left shoe on its side is not a right shoe.
"""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from burg_drake.core import Array, rot_z

TOLERANCE = 0.025
"""Largest deviation that still counts as the same shape, as a share of the object's diagonal."""

DENSE = 16000
"""Points that stand for the surface."""

SPARSE = 500
"""Points that are turned and compared with the surface."""

COVERED = 0.98
"""Share of the turned points that must be within the tolerance."""

SECTORS = 72
"""Resolution of the first search over the angle about the vertical."""


class SymmetryTest:
    """Compares an object with itself in two orientations.

    Args:
        surface: in O [m].
        p_OOcm: (3,) centre of mass; all turns are about it [m].
    """

    def __init__(self, surface: trimesh.Trimesh, p_OOcm: Array) -> None:
        points, normals = sample_surface(surface, DENSE)
        self.points = points - p_OOcm
        self.normals = normals
        self.tolerance = TOLERANCE * float(np.linalg.norm(np.ptp(self.points, axis=0)))
        # with the normals among the coordinates the two sides of a thin wall lie apart
        self.tree = cKDTree(np.hstack([self.points, self.tolerance * normals]))
        self.probe = self.points[:: DENSE // SPARSE]
        self.probe_normals = normals[:: DENSE // SPARSE]
        self._profiles: dict[bytes, Array] = {}

    def same(self, down_a: Array, down_b: Array) -> bool:
        """Whether some turn of the object onto itself takes direction a of O to direction b."""
        profile_a, profile_b = self._profile(down_a), self._profile(down_b)
        shape_a, shape_b = profile_a.sum(axis=0), profile_b.sum(axis=0)
        if np.abs(shape_a - shape_b).sum() > 0.5 * shape_a.sum():
            return False
        match = np.fft.irfft(
            (np.fft.rfft(profile_b, axis=0) * np.conj(np.fft.rfft(profile_a, axis=0))).sum(axis=1),
            SECTORS,
        )
        best = np.argsort(-match, kind="stable")
        chosen: list[int] = []
        for k in best.tolist():
            if all(min((k - c) % SECTORS, (c - k) % SECTORS) > 2 for c in chosen):
                chosen.append(k)
            if len(chosen) == 6:
                break
        R_Ba, R_Bb = down_frame(down_a), down_frame(down_b)
        return any(self._aligned(R_Ba, R_Bb, 2.0 * np.pi * k / SECTORS) for k in chosen)

    def _profile(self, down: Array) -> Array:
        """(SECTORS, bins) area by azimuth, height and radius, about the vertical."""
        key = down.tobytes()
        if key not in self._profiles:
            p = self.points @ down_frame(down).T
            azimuth = (np.arctan2(p[:, 1], p[:, 0]) / (2.0 * np.pi) % 1.0) * SECTORS
            size = np.linalg.norm(np.ptp(self.points, axis=0))
            radius = np.hypot(p[:, 0], p[:, 1]) / size
            height = p[:, 2] / size + 1.0
            grid = (
                azimuth.astype(int) % SECTORS,
                (height * 8).astype(int),
                (radius * 8).astype(int),
            )
            flat = np.ravel_multi_index(grid, (SECTORS, 17, 9))
            count = np.bincount(flat, minlength=SECTORS * 17 * 9)
            self._profiles[key] = count.reshape(SECTORS, -1).astype(float)
        return self._profiles[key]

    def _aligned(self, R_Ba: Array, R_Bb: Array, angle: float) -> bool:
        """Refines the angle by iterated closest points, and tells whether the turn fits."""
        for _ in range(8):
            R = R_Bb.T @ rot_z(angle) @ R_Ba
            turned = self.probe @ R.T
            facing = self.probe_normals @ R.T
            _, index = self.tree.query(np.hstack([turned, self.tolerance * facing]))
            p, q = turned @ R_Bb.T, self.points[index] @ R_Bb.T
            cross = (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum()
            step = float(np.arctan2(cross, (p[:, :2] * q[:, :2]).sum()))
            angle += step
            if abs(step) < 2e-3:
                break
        alike = (facing * self.normals[index]).sum(axis=1) > 0.0
        near = np.linalg.norm(turned - self.points[index], axis=1) < self.tolerance
        return bool((near & alike).mean() >= COVERED)


def sample_surface(surface: trimesh.Trimesh, count: int) -> tuple[Array, Array]:
    """Points (count, 3) evenly spread over a surface, and its normals there; no randomness."""
    points, face = spread_over(surface, count)
    triangles = surface.triangles
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(cross, axis=1)
    order = np.argsort((np.arange(count) * 0.6180339887498949) % 1.0, kind="stable")
    return points[order], (cross[face] / np.maximum(area[face], 1e-300)[:, None])[order]


def spread_over(surface: trimesh.Trimesh, count: int) -> tuple[Array, NDArray[np.int64]]:
    """Points (count, 3) evenly spread over a surface, in the order of its triangles, and the number
    (count,) of the triangle of each; no randomness.

    Systematic sampling by area, with the points of each triangle from the R2 sequence.
    """
    triangles = np.asarray(surface.triangles)
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    edges = np.cumsum(np.linalg.norm(cross, axis=1))
    at = (np.arange(count) + 0.5) / count * edges[-1]
    face = np.minimum(np.searchsorted(edges, at), len(triangles) - 1)
    uv = (np.arange(1, count + 1)[:, None] * (0.7548776662466927, 0.5698402909980532)) % 1.0
    uv = np.where(uv.sum(axis=1, keepdims=True) > 1.0, 1.0 - uv, uv)
    t = triangles[face]
    return t[:, 0] + uv[:, :1] * (t[:, 1] - t[:, 0]) + uv[:, 1:] * (t[:, 2] - t[:, 0]), face


def down_frame(down: Array) -> Array:
    """(3, 3) rotation whose third row is -`down`: takes vectors of O to a frame with z up."""
    up = -down
    x = np.cross(up, np.eye(3)[int(np.abs(up).argmin())])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(up, x), up])
