"""A box as a camera sees it, in closed form: tables and boards fill most of an image."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.optics import Intrinsics
from burg_drake.core import Array, Indices, Single, inverse
from burg_drake.dataset.rendering.pixel_rays import flat_directions

NORMALS = np.concatenate([-np.eye(3), np.eye(3)])
"""Of a box's planes: the lower ones along x, y and z, then the upper ones."""
SAME = 1e-9
"""Lengths of a surface that are smaller count as 0 [m]."""
SAME_AREA = 1e-6
"""Share by which the area of a box may differ from what its size says."""


@dataclass(frozen=True, eq=False)
class RayBox:
    """A box, or a rectangle, along the axes of its frame.

    Attributes:
        lower, upper: (3,) its corners [m].
    """

    lower: Array
    upper: Array

    @classmethod
    def of_surface(cls, vertices: Array, faces: Indices) -> RayBox | None:
        """The box whose surface triangles are, however they divide it; None if it is another one.

        Args:
            vertices: (V, 3) [m].
            faces: (F, 3).
        """
        lower, upper = vertices.min(axis=0), vertices.max(axis=0)
        size = upper - lower
        sides = np.minimum(np.abs(vertices - lower), np.abs(vertices - upper)) <= SAME
        area = np.prod(np.sort(size)[1:])
        if size.min() > SAME:
            area = 2.0 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0])
        a, b, c = vertices[faces].transpose(1, 0, 2)
        found = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
        if not sides.any(axis=1).all() or abs(found - area) > SAME_AREA * area:
            return None
        return cls(lower, upper)

    def nearness(self, intrinsics: Intrinsics, X_CB: Array) -> Single | None:
        """(H, W) 1 / z [1/m] of where a camera's rays meet it, 0 where they do not; None if the
        camera is within it or in one of its planes.

        Of a plane n . p = d, d from the camera, a ray along (x, y, 1) meets 1 / z =
        n . (x, y, 1) / d, which is linear in x and y. The ray enters where 1 / z is least among
        the planes that the camera sees from outside, if that is before it leaves by another one.
        """
        enter: Single | None = None
        leave: Single | None = None
        distances = self._distances(X_CB)
        if (distances >= 0.0).all() or (np.abs(distances) < SAME).any():
            return None
        for number, image in self._planes(intrinsics, X_CB):
            if distances[number] > 0.0:
                leave = image if leave is None else np.maximum(leave, image, out=leave)
            else:
                enter = image if enter is None else np.minimum(enter, image, out=enter)
        assert enter is not None and leave is not None
        enter[enter < np.maximum(leave, 0.0, out=leave)] = 0.0
        return enter

    def planes(self, intrinsics: Intrinsics, X_CB: Array) -> NDArray[np.int16]:
        """(H, W) number in `NORMALS` of the plane by which rays enter; where none does, any."""
        enter: Single | None = None
        found = np.zeros((intrinsics.height, intrinsics.width), np.int16)
        distances = self._distances(X_CB)
        for number, image in self._planes(intrinsics, X_CB):
            if distances[number] < 0.0:
                if enter is None:
                    enter = image
                    found[:] = number
                else:
                    np.copyto(found, number, where=image < enter)
                    np.minimum(enter, image, out=enter)
        return found

    def _distances(self, X_CB: Array) -> Array:
        """(6,) of the camera to each plane, below 0 outside [m]."""
        offsets: Array = np.concatenate([-self.lower, self.upper])
        return offsets - NORMALS @ inverse(X_CB)[:3, 3]

    def _planes(self, intrinsics: Intrinsics, X_CB: Array) -> Iterator[tuple[int, Single]]:
        """The number of each plane, and (H, W) 1 / z of where rays meet it, below 0 behind the
        camera."""
        x, y = flat_directions(intrinsics)
        planes = NORMALS @ X_CB[:3, :3].T / self._distances(X_CB)[:, None]
        for number, (a, b, c) in enumerate(planes.astype(np.float32)):
            yield number, (a * x + c) + b * y
