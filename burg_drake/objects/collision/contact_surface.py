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
from burg_drake.geometry import triangle_distances
from burg_drake.objects.collision.fit import surface_distance
from burg_drake.objects.library import Fit
from burg_drake.objects.meshes import coarser_surfaces
from burg_drake.objects.physics import spread_over

MOST_DISTANCE = 2.5e-4
"""Largest distance between the object's surface and that which pads touch, either way [m]."""

MOST_ANGLE = float(np.deg2rad(10.0))
"""Angle from which on a normal counts as turned. It uses up three quarters of the friction cone of
0.24, 13.5 degrees wide to each side; a good grasp must not fail for it."""

TURNED = 0.05
"""Largest share of the area whose normals are turned: next to edges that were moved, within
`MOST_DISTANCE`, they are those of the other side."""

SMOOTHING = 2e-3
"""Normals of the object are also taken in the mean over this radius [m], less than half a pad:
those of a scan jump from face to face, and a pad that yields feels none of it."""

MOST_FACES = 10_000
"""A surface with more faces costs more in simulation than it tells."""

DIGITS = 7
"""Of coordinates in metres: enough for the bounds, and a third of the file."""

SPREAD = 0.8
"""Mean distance over the largest one, at most, of surfaces that are worth a look."""

THINNEST = 1e-6
"""Smallest height of a face [m]: Drake finds no normal of a thinner one."""

SAMPLES, TARGETS, CANDIDATES, NEIGHBOURS = 20_000, 60_000, 8, 24
"""Of the measurement of angles: points on the result, and on the object; faces compared for each;
points whose normals are averaged."""


def contact_surface(
    surface: trimesh.Trimesh,
    closed: bool,
    most_distance: float = MOST_DISTANCE,
    most_angle: float = MOST_ANGLE,
) -> tuple[trimesh.Trimesh, Fit]:
    """The coarsest surface that keeps both bounds.

    Args:
        surface: of the object [m].
        closed: whether it is watertight, wound outward.
        most_distance, most_angle: the bounds [m and rad].

    Returns:
        The surface, closed and wound outward, and how well it fits.

    Raises:
        MeshError: why there is none.
    """
    if not closed:
        raise MeshError("its surface is not closed")
    normals = SurfaceNormals(surface, most_distance)
    for rung in reversed(coarser_surfaces(surface, SPREAD * most_distance)):
        if len(rung.faces) > MOST_FACES:
            break
        mesh = trimesh.Trimesh(np.round(rung.vertices, DIGITS), rung.faces, process=False)
        if thinnest(mesh) < THINNEST or normals.turned_share(mesh, most_angle) > TURNED:
            continue
        distance = surface_distance(mesh, surface, most_distance)
        if distance <= most_distance:
            return mesh, Fit(volume_ratio=float(mesh.volume / surface.volume), hausdorff=distance)
    raise MeshError(
        f"its surface cannot be reduced to {MOST_FACES} faces without being more than "
        f"{1e3 * most_distance:g} mm or {np.rad2deg(most_angle):g} degrees off"
    )


class SurfaceNormals:
    """The normals of a surface, at each place and in the mean around it.

    Args:
        surface: [m].
        reach: how far away a place may be that faces the same way, to count as the nearest [m].
    """

    def __init__(self, surface: trimesh.Trimesh, reach: float = MOST_DISTANCE) -> None:
        self.reach = reach
        self.triangles = np.asarray(surface.triangles)
        self.normals = np.asarray(surface.face_normals)
        self.samples, self.owner = spread_over(surface, TARGETS)
        self.every = np.concatenate([self.owner, np.arange(len(self.triangles))])
        self.places = cKDTree(np.vstack([self.samples, self.triangles.mean(axis=1)]))
        self.even = cKDTree(self.samples)
        alike = SMOOTHING * self.normals[self.owner]
        self.alike = cKDTree(np.hstack([self.samples, alike]))

    def turned_share(self, mesh: trimesh.Trimesh, most_angle: float = MOST_ANGLE) -> float:
        """Share of a mesh's area whose normals are more than an angle [rad] off the
        surface's, both of the nearest place and of the mean around it."""
        points, face = spread_over(mesh, SAMPLES)
        normals = np.asarray(mesh.face_normals)[face]
        own = self._nearest(points, normals)
        mean = self._mean(points, own)
        cosine = np.maximum((own * normals).sum(axis=1), (mean * normals).sum(axis=1))
        return float((cosine < np.cos(most_angle)).mean())

    def _nearest(self, points: Array, normals: Array) -> Array:
        """Normals (N, 3) of the surface at the nearest places: within `reach` at those that
        face the same way, as near a thin wall its other side may be nearer."""
        _, near = self.places.query(points, min(CANDIDATES, len(self.every)))
        _, alike = self.alike.query(np.hstack([points, SMOOTHING * normals]), CANDIDATES)
        which = np.hstack([self.every[near], self.owner[alike]])
        apart = triangle_distances(points[:, None], self.triangles[which])
        facing = (self.normals[which] * normals[:, None]).sum(axis=2) > 0.0
        apart -= np.where(facing & (apart <= self.reach), self.reach, 0.0)
        return np.asarray(self.normals[which[np.arange(len(points)), apart.argmin(axis=1)]])

    def _mean(self, points: Array, own: Array) -> Array:
        """Normals (N, 3) in the mean around points, of what faces the same way as `own`."""
        distance, around = self.even.query(points, NEIGHBOURS, distance_upper_bound=SMOOTHING)
        within = np.isfinite(distance)
        others = self.normals[self.owner[np.where(within, around, 0)]]
        facing = within & ((others * own[:, None]).sum(axis=2) > 0.0)
        mean = (others * facing[..., None]).sum(axis=1)
        length = np.linalg.norm(mean, axis=1, keepdims=True)
        return np.asarray(mean / np.maximum(length, 1e-300))


def excess(mesh: trimesh.Trimesh, pieces: Sequence[trimesh.Trimesh]) -> float:
    """How far a surface stands out of the union of convex pieces, at most [m]."""
    points = np.vstack([mesh.vertices, spread_over(mesh, SAMPLES)[0]])
    height = np.full(len(points), np.inf)
    for piece in pieces:
        planes = np.asarray(piece.face_normals)
        offset = (planes * piece.triangles[:, 0]).sum(axis=1)
        for some in np.array_split(np.arange(len(points)), max(1, len(planes) // 100)):
            above = (points[some] @ planes.T - offset).max(axis=1)
            height[some] = np.minimum(height[some], above)
    return max(0.0, float(height.max()))


def thinnest(mesh: trimesh.Trimesh) -> float:
    """Smallest height of a face over its longest edge [m]."""
    t = np.asarray(mesh.triangles)
    longest = np.linalg.norm(t - np.roll(t, 1, axis=1), axis=2).max(axis=1)
    return float((2.0 * mesh.area_faces / np.maximum(longest, 1e-300)).min())
