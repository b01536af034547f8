"""What rays through the pixels' centres meet: exact depth, labels, normals and silhouettes.

They are the same whatever renderer makes the colours, and where there is none. Rays are cast at
each surface alone, within the pixels that can show it: an image is the nearest of all, and the
silhouettes are there as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Single, inverse
from burg_drake.dataset.rendering.images import SURROUNDINGS, Images
from burg_drake.dataset.rendering.ray_box import NORMALS
from burg_drake.dataset.rendering.ray_surface import NONE, Met, RaySurface
from burg_drake.dataset.views import View


@dataclass(frozen=True, eq=False)
class Silhouette:
    """All that a camera would see of an object if it were alone.

    Attributes:
        left, top: column and row of the image where `mask` begins; they may lie outside [pixels].
        mask: (h, w) the smallest rectangle that holds it; empty if there is none.
    """

    left: int
    top: int
    mask: NDArray[np.bool_]

    def within(self, width: int, height: int) -> NDArray[np.bool_]:
        """(height, width) the part that lies in an image of that size."""
        image = np.zeros((height, width), bool)
        rows, columns = self.mask.shape
        x, y = max(self.left, 0), max(self.top, 0)
        right, bottom = min(self.left + columns, width), min(self.top + rows, height)
        if x < right and y < bottom:
            part = self.mask[y - self.top : bottom - self.top, x - self.left : right - self.left]
            image[y:bottom, x:right] = part
        return image


class RayScene:
    """Surfaces at their places in S, and rays at them.

    Args:
        surfaces: at most one of each label but for `SURROUNDINGS`.
        X_SB: (4, 4) frame of each; all in S if None.
    """

    def __init__(self, surfaces: Sequence[RaySurface], X_SB: Sequence[Array] | None = None) -> None:
        poses = [np.eye(4)] * len(surfaces) if X_SB is None else X_SB
        self._placed = list(zip(surfaces, poses, strict=True))
        self._of_label = {one.label: (one, pose) for one, pose in self._placed}
        self._last: tuple[View | None, dict[int, Met | None]] = None, {}

    def images(self, view: View, *, normals: bool = False) -> Images:
        """Depth and labels of a view; its normals as well if asked for."""
        depth, directions, meshes = self._boxes_seen(view, normals)
        labels = np.full(depth.shape, SURROUNDINGS, np.uint16)
        self._last = view, {}
        for surface, X_CB in meshes:
            met = surface.met(view.intrinsics, X_CB)
            self._last[1][surface.label] = met
            if met is None:
                continue
            left, top, right, bottom = met.pixels
            part = np.s_[top:bottom, left:right]
            nearest = met.depth < depth[part]
            depth[part][nearest] = met.depth[nearest]
            labels[part][nearest] = surface.label
            if directions is not None:
                directions[part][nearest] = surface.normals(met, X_CB)[nearest]
        near, far = view.depth_range
        depth[(depth < near) | (depth > far)] = 0.0
        return Images(depth=depth, labels=labels, normals=directions)

    def silhouette(self, number: int, view: View) -> Silhouette:
        """As `SceneRenderer.silhouette`."""
        met = self._met_whole(number, view)
        mask = np.zeros((0, 0), bool) if met is None else met.face != NONE
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        if met is None or not len(rows):
            return Silhouette(0, 0, np.zeros((0, 0), bool))
        cut = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        left, top, _, _ = met.pixels
        return Silhouette(left + int(columns[0]), top + int(rows[0]), cut)

    def _boxes_seen(
        self, view: View, normals: bool
    ) -> tuple[Single, Single | None, list[tuple[RaySurface, Array]]]:
        """Depth and normals of what is seen of boxes alone, and what rays have to be cast at."""
        shape = view.intrinsics.height, view.intrinsics.width
        nearness: Single = np.zeros(shape, np.float32)
        plane, directions = np.zeros(shape, np.int16), [np.zeros((1, 3))]
        meshes, X_CS = [], inverse(view.X_SC)
        for surface, X_SB in self._placed:
            X_CB, box, seen = X_CS @ X_SB, surface.box, None
            if box is not None and surface.label == SURROUNDINGS:
                seen = box.nearness(view.intrinsics, X_CB)
            if box is None or seen is None:
                meshes.append((surface, X_CB))
                continue
            if normals:
                planes = box.planes(view.intrinsics, X_CB)
                np.copyto(plane, planes + sum(map(len, directions)), where=seen > nearness)
                directions.append(NORMALS @ X_CB[:3, :3].T)
            np.maximum(nearness, seen, out=nearness)
        of_plane = np.concatenate(directions).astype(np.float32)
        with np.errstate(divide="ignore"):
            depth = np.divide(1.0, nearness, out=nearness)
        return depth, np.take(of_plane, plane, axis=0) if normals else None, meshes

    def _met_whole(self, number: int, view: View) -> Met | None:
        """What rays in the image and beyond it meet of an object; what the last image found of it
        if that is all."""
        last, found = self._last
        known = found.get(number) if last is view else None
        if known is not None:
            left, top, right, bottom = known.pixels
            width, height = view.intrinsics.width, view.intrinsics.height
            if left > 0 and top > 0 and right < width and bottom < height:
                return known
        surface, X_SB = self._of_label[number]
        return surface.met(view.intrinsics, inverse(view.X_SC) @ X_SB, beyond=True)
