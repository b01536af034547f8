"""Shape of an object at its target: mesh, reference point and rotational symmetry."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, cKDTree

from burg_drake.cameras.scene_mesh import MeshOutline
from burg_drake.core import (
    Array,
    Indices,
    inverse,
    make_pose,
    rot_z,
    srgb_to_linear,
    transform_points,
)
from burg_drake.geometry import RayCaster
from burg_drake.objects import sample_surface
from burg_drake.scene import Scene

SURFACE_SAMPLES = 12_000
"""Points sampled on a surface."""
SYMMETRY_TEST_ANGLES = np.deg2rad((11.0, 37.0, 73.0, 117.0, 161.0))
"""Radians. No symmetry of order up to 36 contains all these turns."""


@dataclass(frozen=True, eq=False)
class TargetShape:
    """An object at its target.

    Attributes:
        vertices: (V, 3) in O [m].
        faces: (F, 3).
        X_SO: (4, 4) target pose.
        p_OR: (3,) reference point, in the plane of the board at the target [m].
        symmetric: whether all turns about the vertical through the reference point look the same.
        colors: (F, 3) linear reflectance of the library's mesh; None if it has no colours.
    """

    vertices: Array
    faces: Indices
    X_SO: Array
    p_OR: Array
    symmetric: bool
    colors: Array | None

    @cached_property
    def p_SR(self) -> Array:
        """(3,) reference point of the target in S [m]."""
        return transform_points(self.X_SO, self.p_OR[None])[0]

    @cached_property
    def p_SV(self) -> Array:
        """(V, 3) vertices at the target in S [m]."""
        return transform_points(self.X_SO, self.vertices)

    @cached_property
    def outline(self) -> MeshOutline:
        """Contours of the mesh at the target, in S."""
        return MeshOutline(self.p_SV, self.faces)

    @cached_property
    def rays(self) -> RayCaster:
        """Ray caster for the mesh at the target, in S."""
        return RayCaster(self.p_SV, self.faces)

    @cached_property
    def normals(self) -> Array:
        """(F, 3) of the faces at the target, in S."""
        a, b, c = np.moveaxis(self.p_SV[self.faces], 1, 0)
        normal = np.cross(b - a, c - a)
        return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)

    @cached_property
    def surface(self) -> tuple[Array, Array]:
        """Points (N, 3) spread over the surface at the target, and their normals, in S."""
        mesh = trimesh.Trimesh(self.p_SV, self.faces, process=False)
        return sample_surface(mesh, SURFACE_SAMPLES)

    def looks_alike(self, a: Array, b: Array) -> bool:
        """Whether the object looks the same at two displacements (3,), as a box does after half a
        turn.
        """
        X_SS = inverse(self.displacement(a)) @ self.displacement(b)
        points, _ = self.surface
        return self._matcher.contains_points(transform_points(X_SS, points[::12]))

    @cached_property
    def _matcher(self) -> _SurfaceMatcher:
        return _SurfaceMatcher(*self.surface)

    def displacement(self, q: Array) -> Array:
        """(4, 4) transform of points in S by `q`: a turn about the vertical through the target's
        reference point, then a translation.

        Args:
            q: (3,) x and y [m], and angle [rad].
        """
        R = rot_z(float(q[2]))
        shift = np.array([q[0], q[1], 0.0])
        return make_pose(R, self.p_SR - R @ self.p_SR + shift)

    def placed(self, q: Array) -> Array:
        """(4, 4) X_SO after the displacement `q`."""
        return self.displacement(q) @ self.X_SO


@lru_cache(maxsize=4)
def target_shapes(scene: Scene) -> dict[str, TargetShape]:
    """The shapes of all instances of a scene, free ones first; cached for further photos of the
    scene.

    Raises:
        UnknownNameError: a mesh file is missing.
    """
    shapes: dict[str, TargetShape] = {}
    for name in (*scene.instances, *scene.background):
        entry = scene.entry(name)
        mesh = scene.library.surface(scene.instance(name).object)
        colors = _face_colors(mesh, scene.library.path(entry.mesh))
        vertices = np.asarray(mesh.vertices)
        shapes[name] = target_shape(vertices, mesh.faces, scene.X_SO(name), colors)
    return shapes


def _face_colors(surface: trimesh.Trimesh, path: Path) -> Array | None:
    """(F, 3) linear reflectance of a surface's faces, from the visual mesh file; None if it has no
    colours.
    """
    seen = trimesh.load(path, force="mesh", process=False)
    if not seen.visual.defined:
        return None
    visual = seen.visual.to_color() if seen.visual.kind == "texture" else seen.visual
    levels = np.asarray(visual.vertex_colors)[:, :3][seen.faces].mean(axis=1)
    _, nearest = cKDTree(seen.triangles_center).query(surface.triangles_center)
    return np.asarray(srgb_to_linear(np.round(levels).astype(np.uint8))[nearest], dtype=float)


def target_shape(
    vertices: Array, faces: NDArray[Any], X_SO: Array, colors: Array | None = None
) -> TargetShape:
    """The shape of a mesh at its target.

    Args:
        vertices: (V, 3) in O [m].
        faces: (F, 3).
        X_SO: (4, 4) target pose.
        colors: (F, 3) linear reflectance; None if it is not known.
    """
    p_SV = transform_points(X_SO, vertices)
    p_SR = np.array([*_outline_centroid(p_SV[:, :2]), 0.0])
    p_OR = transform_points(inverse(X_SO), p_SR[None])[0]
    surface = trimesh.Trimesh(p_SV - p_SR, faces, process=False)
    return TargetShape(
        vertices, np.asarray(faces), X_SO, p_OR, _is_rotationally_symmetric(surface), colors
    )


def _outline_centroid(points: Array) -> Array:
    """Centroid of the convex hull of points (N, 2); it rotates with the points."""
    hull = points[ConvexHull(points).vertices]
    scale = float(np.ptp(hull, axis=0).max())
    origin = hull.mean(axis=0)
    moments = cv2.moments(((hull - origin) / scale).astype(np.float32)[:, None])
    middle = np.array([moments["m10"], moments["m01"]]) / moments["m00"]
    return origin + scale * middle


def _is_rotationally_symmetric(surface: trimesh.Trimesh) -> bool:
    """Whether a surface looks the same after any turn about the z axis of its frame."""
    points, normals = sample_surface(surface, SURFACE_SAMPLES)
    matcher = _SurfaceMatcher(points, normals)
    return all(
        matcher.contains_points(points[::12] @ rot_z(float(angle)).T)
        for angle in SYMMETRY_TEST_ANGLES
    )


class _SurfaceMatcher:
    """Tests whether moved surface points are still on the surface.

    Args:
        points, normals: (N, 3) spread over the surface.
    """

    def __init__(self, points: Array, normals: Array) -> None:
        self._points, self._normals = points, normals
        self._tree = cKDTree(points)
        # Fraction of the diagonal; 1.3 mm for a can.
        self._tolerance = 0.01 * float(np.linalg.norm(np.ptp(points, axis=0)))
        apart = self._tree.query(points[::12], k=2)[0][:, 1]
        self._max_distance = 6.0 * float(np.median(apart)) + self._tolerance

    def contains_points(self, moved: Array) -> bool:
        """Whether most of the moved points (M, 3) are on the surface."""
        distance, near = self._tree.query(moved, k=3)
        difference = moved[:, None] - self._points[near]
        plane_distance = np.abs(np.einsum("nki,nki->nk", self._normals[near], difference)).min(
            axis=1
        )
        same = (plane_distance < self._tolerance) & (distance[:, 0] < self._max_distance)
        # Fraction of the surface that must be within the tolerance.
        return bool(same.mean() >= 0.98)
