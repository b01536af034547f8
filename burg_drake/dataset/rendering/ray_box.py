"""A box as a camera sees it, in closed form: tables and boards fill most of an image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.optics import Intrinsics
from burg_drake.core import Array, Indices, Single, inverse
from burg_drake.dataset.rendering.pixel_rays import flat_directions

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

    def seen(self, intrinsics: Intrinsics, X_CB: Array) -> tuple[Single, NDArray[np.int8]] | None:
        """What a camera outside sees of it.

        Of a plane n . p = d, a ray along (x, y, 1) meets 1 / z = n . (x, y, 1) / d, which is linear
        in x and y: the ray enters where 1 / z is least among the planes whose front the camera
        sees, if it does so before it leaves by another one.

        Returns:
            (H, W) 1 / z [1/m], 0 where it is not met, and (H, W) which plane is met: 0 to 2 for the
            lower ones along x, y and z, 3 to 5 for the upper ones; None if the camera is within it
            or in one of its planes.
        """
        x, y = flat_directions(intrinsics)
        normals = np.concatenate([-np.eye(3), np.eye(3)])
        offsets = np.concatenate([-self.lower, self.upper])
        distances = offsets - normals @ inverse(X_CB)[:3, 3]  # of the camera, below 0 outside
        if (distances >= 0.0).all() or (np.abs(distances) < SAME).any():
            return None
        planes = (normals @ X_CB[:3, :3].T / distances[:, None]).astype(np.float32)
        enter: Single | None = None
        leave: Single | None = None
        plane = np.zeros((intrinsics.height, intrinsics.width), np.int8)
        for number, (a, b, c) in enumerate(planes):
            nearness = (a * x + c) + b * y
            if distances[number] > 0.0:
                leave = nearness if leave is None else np.maximum(leave, nearness, out=leave)
            elif enter is None:
                enter = nearness
                plane[:] = number
            else:
                plane[nearness < enter] = number
                np.minimum(enter, nearness, out=enter)
        assert enter is not None and leave is not None
        enter[enter < np.maximum(leave, 0.0, out=leave)] = 0.0
        return enter, plane
