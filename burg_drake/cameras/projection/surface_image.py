"""What surface each pixel of a camera shows, by rays: few within surfaces, one a pixel at borders.

Rays go through every fourth pixel of every fourth row. Where the four around a block see the same
object, and no outline runs through the block, all of it does; other blocks get a ray a pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.optics import NEAR, FieldOfView
from burg_drake.cameras.projection.line_drawing import OUTLINE, VisibleLines
from burg_drake.cameras.projection.scene_mesh import SceneMesh
from burg_drake.core import Array, inverse, transform_points

BLOCK = 4
"""Pixels between the rays that look where something is, in rows and columns."""
NOTHING = -1


@dataclass(frozen=True, eq=False)
class SurfaceImage:
    """What the pixels show.

    Attributes:
        owner: (H, W) number of the instance, `NOTHING` where there is none.
        shade: (H, W) brightness of the surface as bytes; 0 where there is none.
    """

    owner: NDArray[np.int16]
    shade: NDArray[np.uint8]


class SurfaceCamera:
    """Sees the surfaces of a scene.

    Attributes:
        shape: of the scene.
    """

    def __init__(self, shape: SceneMesh, view: FieldOfView) -> None:
        self.shape = shape
        directions = view.directions
        self._directions = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
        self._size = directions.shape[:2]
        rows, columns = (np.minimum(np.arange(0, n + BLOCK, BLOCK), n - 1) for n in self._size)
        # One node more than blocks in each direction; the last may stand nearer.
        blocks = [-(-n // BLOCK) for n in self._size]
        self._nodes = np.ix_(rows[: blocks[0] + 1], columns[: blocks[1] + 1])
        self._x, self._y = np.moveaxis(directions[self._nodes][..., :2], 2, 0).copy()

    def render(self, X_SC: Array, lines: VisibleLines, shades: NDArray[np.uint8]) -> SurfaceImage:
        """The surfaces from a pose of the camera.

        Args:
            X_SC: (4, 4) camera's optical frame in the scene frame.
            lines: that it sees from there, `line_drawing.visible_lines`.
            shades: (F,) brightness of each face.
        """
        owner, shade = self._at_nodes(X_SC, shades)
        corners = np.stack([owner[:-1, :-1], owner[:-1, 1:], owner[1:, :-1], owner[1:, 1:]])
        mixed = (corners != corners[0]).any(axis=0) | self._outline_blocks(lines)
        image = SurfaceImage(_upsampled(corners[0], self._size), self._interpolate(shade))
        image.shade[image.owner == NOTHING] = 0
        blocks = np.argwhere(mixed)
        within = np.stack(np.meshgrid(*[np.arange(BLOCK)] * 2, indexing="ij"), -1).reshape(1, -1, 2)
        pixels = (blocks[:, None] * BLOCK + within).reshape(-1, 2)
        pixels = pixels[(pixels < self._size).all(axis=1)]
        at = pixels[:, 0], pixels[:, 1]
        image.owner[at], image.shade[at] = self._cast(X_SC, self._directions[at], shades)
        return image

    def _at_nodes(
        self, X_SC: Array, shades: NDArray[np.uint8]
    ) -> tuple[NDArray[np.int16], NDArray[np.uint8]]:
        """Owner and shade at the nodes; rays are cast where there may be something."""
        looking = self._candidate_nodes(X_SC)
        owner = np.full(looking.shape, NOTHING, np.int16)
        shade = np.zeros(looking.shape, np.uint8)
        directions = self._directions[self._nodes][looking]
        owner[looking], shade[looking] = self._cast(X_SC, directions, shades)
        return owner, shade

    def _candidate_nodes(self, X_SC: Array) -> NDArray[np.bool_]:
        """Nodes that look into the smallest upright rectangle around an instance's box."""
        showing = np.zeros(self._x.shape, bool)
        X_CS = inverse(X_SC)
        for lower, upper in self.shape.boxes:
            corners = np.stack(np.meshgrid(*np.stack([lower, upper], axis=1)), -1).reshape(-1, 3)
            p_CQ = transform_points(X_CS, corners)
            if (p_CQ[:, 2] < NEAR).all():
                continue
            if (p_CQ[:, 2] < NEAR).any():
                return np.ones_like(showing)
            seen = p_CQ[:, :2] / p_CQ[:, 2:]
            (left, top), (right, bottom) = seen.min(axis=0), seen.max(axis=0)
            within = (self._x >= left) & (self._x <= right)
            showing |= within & (self._y >= top) & (self._y <= bottom)
        return showing

    def _cast(
        self, X_SC: Array, directions: Array, shades: NDArray[np.uint8]
    ) -> tuple[NDArray[np.int16], NDArray[np.uint8]]:
        """Owner and shade of what rays (..., 3) in C meet."""
        flat = directions.reshape(-1, 3) @ X_SC[:3, :3].T
        if not len(flat):
            return np.empty(directions.shape[:-1], np.int16), np.empty(
                directions.shape[:-1], np.uint8
            )
        face, _ = self.shape.rays.first_hits(np.broadcast_to(X_SC[:3, 3], flat.shape), flat)
        missed = face < 0
        owner = np.where(missed, NOTHING, self.shape.owner[face]).astype(np.int16)
        shade = np.where(missed, 0, shades[face]).astype(np.uint8)
        return owner.reshape(directions.shape[:-1]), shade.reshape(directions.shape[:-1])

    def _outline_blocks(self, lines: VisibleLines) -> NDArray[np.bool_]:
        """Blocks that an outline runs through, or within a pixel of; it is cut into short bits."""
        rows, columns = (-(-n // BLOCK) for n in self._size)
        crossed = np.zeros((rows, columns), bool)
        points = lines.ends[lines.kind == OUTLINE].reshape(-1, 2)
        for shift in ((-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)):
            column, row = np.floor((points + np.array(shift)) / BLOCK).astype(int).T
            kept = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
            crossed[row[kept], column[kept]] = True
        return crossed

    def _interpolate(self, shade: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Shades between the nodes."""
        import cv2

        scale = np.array([[BLOCK, 0.0, 0.0], [0.0, BLOCK, 0.0]])
        height, width = self._size
        spread = cv2.warpAffine(
            shade, scale, (width, height), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        return np.asarray(spread, np.uint8)


def _upsampled(owner: NDArray[np.int16], size: tuple[int, ...]) -> NDArray[np.int16]:
    whole = np.repeat(np.repeat(owner, BLOCK, axis=0), BLOCK, axis=1)
    return np.ascontiguousarray(whole[: size[0], : size[1]])
