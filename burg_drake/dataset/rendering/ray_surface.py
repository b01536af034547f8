"""A surface that rays of a camera meet, in the frame of its body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.optics import Intrinsics
from burg_drake.core import Array, Indices, Single, transform_points
from burg_drake.dataset.rendering.images import SURROUNDINGS
from burg_drake.dataset.rendering.pixel_rays import PixelBox, pixels_around, unit_directions
from burg_drake.dataset.rendering.ray_box import RayBox
from burg_drake.geometry import RayCaster

NONE = -1
"""Face of a ray that meets nothing."""


@dataclass(frozen=True, eq=False)
class Met:
    """What the rays of a rectangle of pixels meet of one surface.

    Attributes:
        pixels: the rectangle.
        unit: (N, 3) directions of the rays in the camera's frame, row by row.
        face: (h, w) face that each meets, `NONE` for none.
        depth: (h, w) along the optical axis [m], infinite for none.
    """

    pixels: PixelBox
    unit: Single
    face: NDArray[np.int32]
    depth: Single


class RaySurface:
    """Triangles of one label.

    Attributes:
        label: of the pixels that show it.
        box: which box they make, if one.
    """

    def __init__(self, label: int, vertices: Array, faces: Indices) -> None:
        """Takes the surface.

        Args:
            label: of the pixels that show it.
            vertices: (V, 3) in the body's frame [m].
            faces: (F, 3) with F >= 1.
        """
        self.label = label
        self._vertices, self._faces = vertices, faces
        self.box = RayBox.of_surface(vertices, faces)

    def met(self, intrinsics: Intrinsics, X_CB: Array, *, beyond: bool = False) -> Met | None:
        """What a camera's rays meet; None if there are no pixels that could show it.

        Args:
            intrinsics: of the camera.
            X_CB: (4, 4) the body in the camera's frame.
            beyond: whether rays beyond the image's edges count, see `pixels_around`.
        """
        p_CQ = transform_points(X_CB, self._vertices)
        pixels = pixels_around(p_CQ, self._faces, intrinsics, beyond=beyond)
        if pixels is None:
            return None
        unit = unit_directions(intrinsics, pixels)
        R_BC = X_CB[:3, :3].T
        face, distance = self._rays.seen_from(-R_BC @ X_CB[:3, 3], _turned(unit, R_BC))
        distance *= unit[:, 2]
        distance[face == NONE] = np.inf
        shape = pixels[3] - pixels[1], pixels[2] - pixels[0]
        return Met(pixels, unit, face.reshape(shape), distance.reshape(shape))

    def normals(self, met: Met, X_CB: Array) -> Single:
        """(h, w, 3) unit normals of the faces that are met, in the camera's frame, towards it;
        those of pixels that meet nothing mean nothing."""
        normals = self._normals @ X_CB[:3, :3].astype(np.float32).T
        seen: Single = normals[met.face.ravel()]
        seen[np.einsum("ij,ij->i", seen, met.unit) > 0.0] *= -1.0
        return seen.reshape(*met.face.shape, 3)

    @cached_property
    def _rays(self) -> RayCaster:
        return RayCaster(self._vertices, self._faces)

    @cached_property
    def _normals(self) -> Single:
        """(F, 3) unit normals, zeros for a face without area."""
        a, b, c = self._vertices[self._faces].transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        unit = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0.0)
        single: Single = unit.astype(np.float32)
        return single


def surfaces_of_body(label: int, parts: Sequence[tuple[Array, Indices]]) -> list[RaySurface]:
    """The surfaces that stand for a body's shapes, as few as possible: one for an object, and for
    what makes a box together, such as the two colours of a board.

    Args:
        label: of the body.
        parts: vertices (V, 3) in the body's frame [m] and faces (F, 3) of each shape.
    """
    parts = [one for one in parts if len(one[1])]
    if not parts:
        return []
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts[:-1])])
    whole = RaySurface(
        label,
        np.concatenate([vertices for vertices, _ in parts]),
        np.concatenate([faces + start for (_, faces), start in zip(parts, starts, strict=True)]),
    )
    if label != SURROUNDINGS or whole.box is not None:
        return [whole]
    return [RaySurface(label, vertices, faces) for vertices, faces in parts]


def _turned(unit: Single, R_BC: Array) -> Single:
    """(N, 3) vectors turned; a matrix product of such a shape starts threads, and takes longer."""
    import cv2

    turned = cv2.transform(unit[:, None], R_BC.astype(np.float32))
    return np.asarray(turned, np.float32).reshape(-1, 3)
