"""The closed surface of an object that gripper pads touch: its mesh with as few faces as will do.

Convex pieces overlap, and their seams and bulges are not there on the object; pads that meet the
surface itself are pushed along its own normals. What it may be off is bounded in distance and in
angle, both measured on the result.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from burg_drake.core import Array, MeshError
from burg_drake.objects.collision.fit import surface_distance
from burg_drake.objects.library import Fit
from burg_drake.objects.meshes import coarser_surfaces
from burg_drake.objects.physics import spread_over

MOST_DISTANCE = 2.5e-4
"""Largest distance between the object's surface and that which pads touch, either way [m]."""

MOST_ANGLE = np.deg2rad(10.0)
"""Angle from which on a normal counts as turned: the force of a pad then leaves the friction cone
of 0.24, 13.5 degrees wide to each side, though the grasp is a good one."""

TURNED = 0.05
"""Largest share of the area whose normals are turned: next to edges that were moved, within
`MOST_DISTANCE`, they are those of the other side."""

SMOOTHING = 2e-3
"""Normals of the object are also taken in the mean over this radius [m], less than half a pad:
those of a scan jump from face to face, and a pad that yields feels none of it."""

MOST_FACES = 10_000
"""A surface with more faces costs more in simulation than it tells."""

THINNEST = 1e-6
"""Smallest height of a face [m]: Drake finds no normal of a thinner one."""

SAMPLES, TARGETS, CANDIDATES, NEIGHBOURS = 20_000, 60_000, 8, 24
"""Of the measurement of angles: points on the result, and on the object; faces compared for each;
points whose normals are averaged."""


def contact_surface(surface: trimesh.Trimesh, closed: bool) -> tuple[trimesh.Trimesh, Fit]:
    """The coarsest surface that keeps both bounds.

    Args:
        surface: of the object [m].
        closed: whether it is watertight, wound outward.

    Returns:
        The surface, closed and wound outward, and how well it fits.

    Raises:
        MeshError: why there is none.
    """
    if not closed:
        raise MeshError("its surface is not closed")
    for mesh in reversed(coarser_surfaces(surface)):
        if len(mesh.faces) > MOST_FACES:
            break
        if thinnest(mesh) < THINNEST or turned_share(mesh, surface) > TURNED:
            continue
        distance = surface_distance(surface, mesh)
        if distance <= MOST_DISTANCE:
            return mesh, Fit(volume_ratio=float(mesh.volume / surface.volume), hausdorff=distance)
    raise MeshError(
        f"its surface cannot be decimated to {MOST_FACES} faces within"
        f" {1e3 * MOST_DISTANCE:g} mm and {np.rad2deg(MOST_ANGLE):g} degrees"
    )


def turned_share(mesh: trimesh.Trimesh, surface: trimesh.Trimesh) -> float:
    """Share of a mesh's area whose normals are more than `MOST_ANGLE` off those of a surface, both
    of the nearest place, and of the mean around it."""
    points, face = spread_over(mesh, SAMPLES)
    normals = np.asarray(mesh.face_normals)[face]
    samples, owner = spread_over(surface, TARGETS)
    every = np.concatenate([owner, np.arange(len(surface.faces))])
    tree = cKDTree(np.vstack([samples, surface.triangles_center]))
    _, near = tree.query(points, min(CANDIDATES, len(every)))
    foot, own = _nearest(points, every[near], surface)
    distance, around = cKDTree(samples).query(
        foot, NEIGHBOURS, distance_upper_bound=SMOOTHING, workers=1
    )
    others = surface.face_normals[owner[np.where(np.isfinite(distance), around, 0)]]
    facing = np.isfinite(distance) & ((others * own[:, None]).sum(axis=2) > 0.0)
    mean = (others * facing[..., None]).sum(axis=1)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    cosine = np.maximum((own * normals).sum(axis=1), (mean * normals).sum(axis=1))
    return float((cosine < np.cos(MOST_ANGLE)).mean())


def excess(mesh: trimesh.Trimesh, pieces: Sequence[trimesh.Trimesh]) -> float:
    """How far a surface stands out of the union of convex pieces, at most [m]."""
    points = np.vstack([mesh.vertices, spread_over(mesh, SAMPLES)[0]])
    height = np.full(len(points), np.inf)
    for piece in pieces:
        planes = np.asarray(piece.face_normals)
        offset = (planes * piece.triangles[:, 0]).sum(axis=1)
        height = np.minimum(height, (points @ planes.T - offset).max(axis=1))
    return max(0.0, float(height.max()))


def thinnest(mesh: trimesh.Trimesh) -> float:
    """Smallest height of a face over its longest edge [m]."""
    t = np.asarray(mesh.triangles)
    longest = np.linalg.norm(t - np.roll(t, 1, axis=1), axis=2).max(axis=1)
    return float((2.0 * mesh.area_faces / np.maximum(longest, 1e-300)).min())


def _nearest(points: Array, which: Array, surface: trimesh.Trimesh) -> tuple[Array, Array]:
    """The nearest points (N, 3) on faces `which` (N, K) of a surface, and its normals there."""
    count, faces = which.shape
    repeated = np.repeat(points, faces, axis=0)
    closest = trimesh.triangles.closest_point(surface.triangles[which.reshape(-1)], repeated)
    apart = np.linalg.norm(closest - repeated, axis=1).reshape(count, faces)
    best = np.arange(count), apart.argmin(axis=1)
    foot = closest.reshape(count, faces, 3)[best]
    return foot, np.asarray(surface.face_normals)[which[best]]
