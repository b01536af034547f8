"""Rays against a triangle mesh: first hits and all hits, on embree's bounding volume hierarchy.

embree works in single precision; the mesh is brought to unit size first, so that distances are
good to about 1e-7 of the mesh's size whatever its unit and place.
"""

from __future__ import annotations

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from burg_drake.core import Array, Indices, Single

START_OFFSET = 1e-5
"""How far a ray starts past its origin, as a share of the mesh's bounding radius. It exceeds the
error of single precision by far, so that a ray never meets the face that it starts on; coincident
faces count as one hit for the same reason."""

MAX_HITS = 64
"""Hits along one ray after which `all_hits` stops looking."""


class RayCaster:
    """The hierarchy of one mesh; build it once, cast many rays.

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
        self.offset = START_OFFSET * self._radius
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
            origins: (N, 3) where the rays start [m]; what is nearer than `offset` is not seen.
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

        A third of its time, for images: nothing is converted, and rays start at the point itself.

        Args:
            origin: (3,) that lies on no face [m].
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
