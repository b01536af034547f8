"""Rays against triangle meshes, by embree's bounding volume hierarchy, and sampling of surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import Array, Indices, InvalidInputError, MeshError, Single

if TYPE_CHECKING:
    import trimesh

MAX_HITS = 64
"""Hits along one ray after which `all_hits` stops."""


class RayCaster:
    """Casts rays against one mesh by a bounding volume hierarchy.

    Attributes:
        offset: distance that rays start past their origins [m].
    """

    def __init__(self, vertices: Array, faces: Indices) -> None:
        """Builds the hierarchy.

        Args:
            vertices: (V, 3) [m].
            faces: (F, 3) indices of their corners, F >= 1.
        """
        used = np.zeros(len(vertices), bool)
        used[faces] = True
        lower, upper = vertices[used].min(axis=0), vertices[used].max(axis=0)
        self._center = 0.5 * (lower + upper)
        self._radius = 0.5 * float(np.linalg.norm(upper - lower)) or 1.0
        self.offset = 1e-5 * self._radius  # so that rays miss the face that they start on
        self._scene = EmbreeScene(robust=True)
        scaled = ((vertices - self._center) / self._radius).astype(np.float32)
        self._geometry = TriangleMesh(
            self._scene, np.ascontiguousarray(scaled), np.ascontiguousarray(faces, np.int32)
        )

    def first_hits(
        self, origins: Array, directions: Array, reach: float = np.inf
    ) -> tuple[Indices, Array]:
        """The nearest face that each ray meets.

        Args:
            origins: (N, 3) starts of the rays [m]; faces nearer than `offset` are missed.
            directions: (N, 3) unit vectors.
            reach: length of the rays [m].

        Returns:
            (N,) face indices, -1 for none, and (N,) distances from the origins [m], inf for none.
        """
        start = (origins + self.offset * directions - self._center) / self._radius
        limit = min(max(reach - self.offset, 0.0) / self._radius, 1e30)
        hits = self._scene.run(
            start.astype(np.float32),
            np.ascontiguousarray(directions, np.float32),
            dists=np.full(len(start), limit, np.float32),
            output=True,
        )
        face = hits["primID"].astype(np.int64)
        distance = self.offset + self._radius * hits["tfar"].astype(float)
        return face, np.where(face >= 0, distance, np.inf)

    def seen_from(self, origin: Array, directions: Single) -> tuple[NDArray[np.int32], Single]:
        """The nearest face that each of many rays from one point meets; see `first_hits`.

        For images: it takes a third of the time, as it converts nothing. Rays start at the point
        itself.

        Args:
            origin: (3,) a point that lies on no face [m].
            directions: (N, 3) unit vectors.

        Returns:
            (N,) face indices, -1 for none, and (N,) distances [m], meaningless for none.
        """
        start = ((origin - self._center) / self._radius).astype(np.float32)
        hits = self._scene.run(
            np.broadcast_to(start, directions.shape).copy(),
            directions,
            dists=np.full(len(directions), 1e30, np.float32),
            output=True,
        )
        return hits["primID"].view(np.int32), hits["tfar"] * np.float32(self._radius)

    def all_hits(
        self, origins: Array, directions: Array, reach: float
    ) -> tuple[Indices, Indices, Array]:
        """Every face that each ray meets within its reach, at most `MAX_HITS` a ray.

        Args:
            origins: (N, 3) [m].
            directions: (N, 3) unit vectors.
            reach: length of the rays [m].

        Returns:
            (M,) ray indices, (M,) face indices and (M,) distances from the origins [m], sorted by
            ray and then by distance.
        """
        rays, faces, distances = [np.empty(0, np.int64)], [np.empty(0, np.int64)], [np.empty(0)]
        live = np.arange(len(origins))
        passed = np.zeros(len(origins))
        for _ in range(MAX_HITS):
            start = origins[live] + passed[live, None] * directions[live]
            face, step = self.first_hits(start, directions[live], reach)
            total = passed[live] + step
            found = total <= reach
            live = live[found]
            if not len(live):
                break
            passed[live] = total[found]
            rays.append(live)
            faces.append(face[found])
            distances.append(total[found])
        ray = np.concatenate(rays)
        order = np.argsort(ray, kind="stable")
        return ray[order], np.concatenate(faces)[order], np.concatenate(distances)[order]


@dataclass(frozen=True, eq=False)
class Surface:
    """A mesh prepared for sampling, without faces of zero area.

    Attributes:
        triangles: (F, 3, 3) corners in the object frame [m].
        normals: (F, 3) outward unit normals.
        cumulative: (F,) cumulative probability of the faces; the last entry is 1.
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
            weights: (F,) density of points on each face of the mesh, at least 0, in any unit;
                uniform if None.

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
        mass = length if weights is None else length * check_face_weights(weights, len(faces))
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


def check_face_weights(weights: ArrayLike, faces: int) -> Array:
    """Checks the weights (F,) of the faces of a mesh, and scales them to at most 1.

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
