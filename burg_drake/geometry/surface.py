"""A triangle mesh made ready for sampling: random points on it, and rays against it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.core import Array, Indices, InvalidInputError, MeshError
from burg_drake.geometry.rays import RayCaster

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True, eq=False)
class Surface:
    """A mesh made ready for sampling; faces without area are left out.

    Attributes:
        triangles: (F, 3, 3) corners in the object frame [m].
        normals: (F, 3) outward unit normals.
        cumulative: (F,) probability of each face and all before it; the last entry is 1.
        rays: caster for these triangles.
    """

    triangles: Array
    normals: Array
    cumulative: Array
    rays: RayCaster

    @classmethod
    def of(cls, mesh: trimesh.Trimesh, weights: ArrayLike | None = None) -> Surface:
        """Reads a mesh.

        Args:
            mesh: surface in the object frame O [m], faces wound so that normals point outward. It
                need not be watertight.
            weights: (F,) density of points on each face of the mesh, from 0, in any unit; uniform
                if None.

        Raises:
            MeshError: the mesh has no face with area, is not finite, or is wound inside out.
            InvalidInputError: the weights do not fit the faces, are negative or not finite, or
                leave no face.
        """
        vertices = np.asarray(mesh.vertices, np.float64)
        if not np.isfinite(vertices).all():
            raise MeshError("the mesh has vertices that are not finite; repair it before sampling")
        faces = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
        triangles = vertices[faces]
        cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        length = np.linalg.norm(cross, axis=1)
        kept = length > 0.0
        if not kept.any():
            raise MeshError("no face of the mesh has an area, so there is nothing to grasp")
        volume = np.einsum("ij,ij->", triangles[:, 0] - vertices.mean(axis=0), cross) / 6.0
        if volume < 0.0 and mesh.is_watertight:
            raise MeshError("the mesh is inside out; flip its faces with mesh.invert()")
        mass = length if weights is None else length * checked_weights(weights, len(faces))
        total = np.cumsum(mass[kept])
        if not total[-1] > 0.0:
            raise InvalidInputError("every face with area has weight 0; give some of them more")
        normals = cross[kept] / length[kept, None]
        rays = RayCaster(vertices, faces[kept])
        return cls(triangles[kept], normals, total / total[-1], rays)

    def draw(self, n: int, rng: np.random.Generator) -> tuple[Array, Indices]:
        """(n, 3) random points on the surface, and their faces (n,).

        Faces have probability proportional to area times weight; points are uniform on a face.
        """
        face = np.searchsorted(self.cumulative, rng.random(n), side="right")
        u, v = rng.random((2, n, 1))
        fold = u + v > 1.0  # the far half of the parallelogram, turned back into the triangle
        u, v = np.where(fold, 1.0 - u, u), np.where(fold, 1.0 - v, v)
        a, b, c = np.swapaxes(self.triangles[face], 0, 1)
        return a + u * (b - a) + v * (c - a), face


def checked_weights(weights: ArrayLike, faces: int) -> Array:
    """Weights (F,) of the faces of a mesh.

    Raises:
        InvalidInputError: see `Surface.of`.
    """
    try:
        values = np.asarray(weights, dtype=float)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"weights of faces have to be numbers: {error}") from error
    if values.shape != (faces,):
        raise InvalidInputError(
            f"weights have shape {values.shape}; the mesh has {faces} faces, give ({faces},)"
        )
    wrong = np.flatnonzero(~(np.isfinite(values) & (values >= 0.0)))
    if len(wrong):
        raise InvalidInputError(
            f"weight of face {wrong[0]} is {values[wrong[0]]:g}; give finite weights from 0"
        )
    if not values.any():
        raise InvalidInputError("every face has weight 0; give some of them more")
    largest: Array = values / values.max()  # no overflow, whatever the unit
    return largest
