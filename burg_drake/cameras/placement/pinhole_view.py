"""An undistorted camera over the board, image windows, and object contours in its image."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.placement.object_shape import TargetShape
from burg_drake.core import Array, Booleans, Indices, inverse, transform_points


@dataclass(frozen=True)
class ImageWindow:
    """A part of an image, sampled by a finer or coarser raster; pixel centres at integers.

    Attributes:
        left, top: first column and row of the image.
        width, height: columns and rows of the image.
        scale: raster pixels per pixel of the image, along both axes.
    """

    left: int
    top: int
    width: int
    height: int
    scale: float = 1.0

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the raster."""
        return round(self.height * self.scale), round(self.width * self.scale)

    def with_raster(self, pixel_count: int) -> ImageWindow:
        """The same part, with a raster of at most about `pixel_count` pixels, no finer than the
        image.
        """
        pitch = max(1.0, float(np.sqrt(self.width * self.height / pixel_count)))
        return replace(self, scale=1.0 / pitch)

    def overlaps(self, other: ImageWindow) -> bool:
        """Whether two windows overlap in the image."""
        across = self.left < other.left + other.width and other.left < self.left + self.width
        return across and self.top < other.top + other.height and other.top < self.top + self.height

    def pixels(self) -> Array:
        """(H, W, 2) image points of the raster's pixels."""
        v, u = np.mgrid[: self.shape[0], : self.shape[1]]
        return self.image(np.stack([u, v], axis=-1))

    def image(self, raster: Array) -> Array:
        """(..., 2) image points of raster coordinates."""
        return (raster + 0.5) / self.scale + (self.left - 0.5, self.top - 0.5)


MIN_POINT_DEPTH = 1e-3
"""Metres. Depth assumed for points nearer to the camera's plane or behind it."""


@dataclass(frozen=True, eq=False)
class PinholeView:
    """A camera without lens distortion.

    Attributes:
        K: (3, 3) camera matrix, pixel centres at integers.
        size: width and height of the image [pixels].
        X_SC: (4, 4) pose of the camera.
        blind: (H, W) pixels without image content; None if there are none.
    """

    K: Array
    size: tuple[int, int]
    X_SC: Array
    blind: Booleans | None = None

    @cached_property
    def X_CS(self) -> Array:
        """(4, 4) pose of the scene frame in the camera frame."""
        return inverse(self.X_SC)

    def project(self, p_SQ: Array) -> tuple[Array, Array]:
        """Points (N, 3) in S, transformed to the camera frame (N, 3), and their pixels (N, 2)."""
        p_CQ = transform_points(self.X_CS, p_SQ)
        depth = np.maximum(p_CQ[:, 2:], MIN_POINT_DEPTH)
        return p_CQ, p_CQ[:, :2] / depth * self.K[[0, 1], [0, 1]] + self.K[:2, 2]

    def jacobian(self, p_SQ: Array) -> Array:
        """(N, 2, 3) derivatives of the pixels by points (N, 3) in S [pixels per metre]."""
        p_CQ, _ = self.project(p_SQ)
        z = np.maximum(p_CQ[:, 2], MIN_POINT_DEPTH)
        fx, fy = self.K[0, 0], self.K[1, 1]
        zero = np.zeros_like(z)
        x = np.stack([fx / z, zero, -fx * p_CQ[:, 0] / z**2], axis=-1)
        y = np.stack([zero, fy / z, -fy * p_CQ[:, 1] / z**2], axis=-1)
        return np.stack([x, y], axis=1) @ self.X_CS[:3, :3]

    def hits(self, shape: TargetShape, q: Array, pixels: Array) -> tuple[Indices, Array]:
        """Casts rays through image points at a displaced shape.

        Args:
            shape: the object.
            q: (3,) its displacement.
            pixels: (..., 2).

        Returns:
            (...,) faces that are hit, -1 for none; and depth along the optical axis [m], infinity
            for none.
        """
        at = pixels.reshape(-1, 2)
        rays = np.ones((len(at), 3))
        rays[:, :2] = (at - self.K[:2, 2]) / self.K[[0, 1], [0, 1]]
        length = np.linalg.norm(rays, axis=1)
        X_OC = inverse(shape.displacement(q)) @ self.X_SC
        direction = (rays / length[:, None]) @ X_OC[:3, :3].T
        origins = np.broadcast_to(X_OC[:3, 3], direction.shape)
        face, distance = shape.rays.first_hits(origins, direction)
        at_pixels = pixels.shape[:-1]
        return face.reshape(at_pixels), (distance / length).reshape(at_pixels)

    def points(self, shape: TargetShape, q: Array, pixels: Array, depth: Array) -> Array:
        """(..., 3) points of a displaced shape at image points (..., 2) with depths (...,), moved
        back to the undisplaced shape [m].
        """
        xy = (pixels - self.K[:2, 2]) / self.K[[0, 1], [0, 1]]
        p_CQ = np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1) * depth[..., None]
        X_SC = inverse(shape.displacement(q)) @ self.X_SC
        return np.asarray(transform_points(X_SC, p_CQ.reshape(-1, 3)).reshape(p_CQ.shape))

    def buffer(self, shape: TargetShape, q: Array, window: ImageWindow) -> Array:
        """(H, W) depth of a displaced shape at the pixels of a window's raster; see `hits`."""
        return self.hits(shape, q, window.pixels())[1]

    def window(self, shape: TargetShape, q: Array, margin: float) -> ImageWindow:
        """The part of the image around a displaced shape."""
        _, pixels = self.project(transform_points(shape.displacement(q), shape.p_SV))
        return self.window_of(pixels, margin)

    def window_of(self, pixels: Array, margin: float) -> ImageWindow:
        """The part of the image around image points (N, 2); empty if all are outside."""
        low = np.floor(pixels.min(axis=0) - margin).astype(int)
        high = np.ceil(pixels.max(axis=0) + margin).astype(int) + 1
        low, high = np.clip(low, 0, self.size), np.clip(high, 0, self.size)
        width, height = np.maximum(high - low, 0)
        return ImageWindow(int(low[0]), int(low[1]), int(width), int(height))

    def depth(self, placed: Iterable[tuple[TargetShape, Array]]) -> Array:
        """(H, W) depth of the nearest of several displaced shapes; infinity where there is none, 0
        where the camera is blind."""
        nearest = np.full(self.size[::-1], np.inf)
        if self.blind is not None:
            nearest[self.blind] = 0.0
        for shape, q in placed:
            window = self.window(shape, q, 1.0)
            part = nearest[window_slices(window)]
            np.minimum(part, self.buffer(shape, q, window), out=part)
        return nearest

    def seen(self, shape: TargetShape, q: Array, others: Array) -> tuple[float, float]:
        """Visible shares of a displaced shape's silhouette.

        Args:
            shape: the object.
            q: (3,) its displacement.
            others: (H, W) depth of possible occluders.

        Returns:
            Share of the silhouette in the image; and share in the image and not hidden.
        """
        p_CV, pixels = self.project(transform_points(shape.displacement(q), shape.p_SV))
        if (p_CV[:, 2] <= MIN_POINT_DEPTH).any():
            return 0.0, 0.0
        low = np.floor(pixels.min(axis=0)).astype(int) - 1
        extent = np.ceil(pixels.max(axis=0)).astype(int) + 2 - low
        scale = min(1.0, 200.0 / extent.max())
        whole = ImageWindow(int(low[0]), int(low[1]), int(extent[0]), int(extent[1]), scale)
        depth = self.buffer(shape, q, whole)
        rows, columns = np.nonzero(np.isfinite(depth))
        at = np.round(whole.image(np.stack([columns, rows], axis=-1))).astype(int)
        inside = ((at >= 0) & (at < self.size)).all(axis=1)
        x, y = at[inside].T
        free = others[y, x] > depth[rows, columns][inside]
        total = max(len(at), 1)
        return float(inside.sum() / total), float(free.sum() / total)


def window_slices(window: ImageWindow) -> tuple[slice, slice]:
    """Slices of the window's part of an image."""
    rows = slice(window.top, window.top + window.height)
    return rows, slice(window.left, window.left + window.width)


def sample_nearest(values: NDArray[Any], pixels: Array, outside: float) -> Array:
    """Samples values (H, W) at the pixels nearest to image points (..., 2); `outside` beyond the
    image.
    """
    at = np.round(pixels).astype(int)
    height, width = values.shape[:2]
    inside = (at[..., 0] >= 0) & (at[..., 0] < width) & (at[..., 1] >= 0) & (at[..., 1] < height)
    x, y = np.clip(at[..., 0], 0, width - 1), np.clip(at[..., 1], 0, height - 1)
    return np.where(inside, values[y, x], outside)


OUTLINE_TEST_OFFSETS_PX = np.array([0.6, 1.2, -0.6])
"""Pixels outward from an outline point; the three test points must be free, free and covered."""
OCCLUSION_DEPTH_STEP = 2e-3
"""Metres by which an occluder must be nearer than an outline point."""


@dataclass(frozen=True, eq=False)
class ImageContour:
    """Points on an outline.

    Attributes:
        pixels: (N, 2) in the image.
        normals: (N, 2) unit vectors in the image, out of the object.
        p_SQ: (N, 3) the points in S [m].
        displacement_jacobian: (N, 3) motion along the normal [pixels] by x, y [m] and angle [rad]
            of the displacement.
        camera_jacobian: (N, 6) motion along the normal [pixels] by the error of the camera's pose,
            which is defined in `BoardEstimate`: rotation [rad], then translation [m].
        view, shape, q: camera, object and its displacement.
    """

    pixels: Array
    normals: Array
    p_SQ: Array
    displacement_jacobian: Array
    camera_jacobian: Array
    view: PinholeView
    shape: TargetShape
    q: Array

    def __len__(self) -> int:
        return len(self.pixels)

    def points(self, offsets: Array) -> Array:
        """(N, T, 2) points on the normals, at distances (T,) from the outline [pixels]."""
        return self.pixels[:, None] + offsets[:, None] * self.normals[:, None]

    def surface_strip(self, pixels: Array, t: Array) -> tuple[Booleans, Array, Array]:
        """Finds the points on the normals that the object covers, and the strip of its surface next
        to the outline.

        Args:
            pixels: (N, T, 2) points on the normals.
            t: (T,) distances of the points from the outline, rising [pixels].

        Returns:
            (N, T) True for covered points; (N,) distance of the strip's inner end (a bend, another
            material, or a part behind it), -infinity if there is none; and (N, 3) ratio of the
            strip's reflectance to that of the surface inside.
        """
        face, depth = self.view.hits(self.shape, self.q, pixels)
        covered = np.isfinite(depth)
        normal, colors = self.shape.normals[face], self.shape.colors
        color = np.full((*face.shape, 3), 0.5) if colors is None else colors[face]
        both = covered[:, 1:] & covered[:, :-1] & (t[1:] <= 0.0)
        middle = (t[1:] + t[:-1]) / 2
        # Difference of reflectance between two materials.
        other = np.abs(np.diff(color, axis=1)).max(axis=-1) > 0.08
        p = self.view.points(self.shape, self.q, pixels, np.where(covered, depth, 1.0))
        away = np.diff(p, axis=1)
        here, before = (np.einsum("nti,nti->nt", n, away) for n in (normal[:, 1:], normal[:, :-1]))
        other |= np.minimum(np.abs(here), np.abs(before)) > 2.0 * OCCLUSION_DEPTH_STEP
        strip = np.where(other & both, middle, -np.inf).max(axis=1)
        last = np.argmax(np.where(covered & (t <= -0.25), t, -np.inf), axis=1)
        begin = normal[np.arange(len(last)), last]
        # Points whose normals differ more get different light.
        turned = np.einsum("nti,ni->nt", normal[:, :-1], begin) < 0.82
        # Normals are compared from a quarter of a pixel inside the outline to 2.5 pixels.
        turned &= both & (middle > -2.5)
        bend = np.where(turned, middle, -np.inf).max(axis=1)
        strip = np.where(np.isfinite(strip), strip, bend)
        line = np.arange(len(strip))
        deep = np.maximum(np.searchsorted(t, np.where(np.isfinite(strip), strip, t[0])) - 2, 0)
        deep = np.where(covered[line, deep] & np.isfinite(strip), deep, last)
        tone = np.maximum(color[line, last], 0.01) / np.maximum(color[line, deep], 0.01)
        return covered, strip, tone


def visible_outline(view: PinholeView, shape: TargetShape, q: Array, others: Array) -> ImageContour:
    """The visible outline of a displaced object in the image.

    Args:
        view: the camera.
        shape: the object.
        q: (3,) its displacement.
        others: (H, W) depth of other objects.
    """
    X_SS = shape.displacement(q)
    mesh = shape.outline
    contour = mesh.contour(transform_points(inverse(X_SS), view.X_SC[:3, 3][None])[0])
    ends = transform_points(X_SS, mesh.vertices[mesh.edges[contour.edges]])
    third = transform_points(X_SS, mesh.vertices[mesh.faces[contour.faces]].mean(axis=1))
    p_SQ, edge = _sample_segments(view, ends)
    p_CQ, pixels = view.project(p_SQ)
    _, e = view.project(ends.reshape(-1, 3))
    e = e.reshape(-1, 2, 2)
    _, m = view.project(third)
    normal_C = e[:, 1] - e[:, 0]
    normal = np.stack([normal_C[:, 1], -normal_C[:, 0]], axis=1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
    inward = np.einsum("ni,ni->n", normal, m - e[:, 0])
    normal = (normal * np.where(inward > 0.0, -1.0, 1.0)[:, None])[edge]
    kept = (p_CQ[:, 2] > MIN_POINT_DEPTH) & (
        (pixels >= 0.0) & (pixels <= np.array(view.size) - 1.0)
    ).all(1)
    kept &= sample_nearest(others, pixels, np.inf) > p_CQ[:, 2] - OCCLUSION_DEPTH_STEP
    beside = pixels[kept, None] + OUTLINE_TEST_OFFSETS_PX[:, None] * normal[kept, None]
    covered = np.isfinite(view.hits(shape, q, beside)[1])
    kept[kept] = ~covered[:, 0] & ~covered[:, 1] & covered[:, 2]
    p_SQ, pixels, normal = p_SQ[kept], pixels[kept], normal[kept]
    J = np.einsum("ni,nij->nj", normal, view.jacobian(p_SQ))
    arm = p_SQ - shape.p_SR - (q[0], q[1], 0.0)
    turn = arm[:, 0] * J[:, 1] - arm[:, 1] * J[:, 0]
    by_camera = np.concatenate([-np.cross(p_SQ - view.X_SC[:3, 3], J), -J], axis=1)
    by_displacement = np.column_stack([J[:, 0], J[:, 1], turn])
    return ImageContour(pixels, normal, p_SQ, by_displacement, by_camera, view, shape, q)


def _sample_segments(view: PinholeView, ends: Array) -> tuple[Array, Indices]:
    """Points (N, 3) spaced evenly in the image over segments (E, 2, 3), and their segments'
    indices.
    """
    spacing = 2.0  # Pixels between points along the outline.
    _, pixels = view.project(ends.reshape(-1, 3))
    pixels = pixels.reshape(-1, 2, 2)
    length = np.linalg.norm(pixels[:, 1] - pixels[:, 0], axis=1)
    length = np.where((pixels.max(axis=1) < 0).any(axis=1), 0.0, np.minimum(length, 1e4))
    stop = np.cumsum(length)
    at = np.arange(spacing / 2, stop[-1] if len(stop) else 0.0, spacing)
    edge = np.searchsorted(stop, at)
    share = (at - (stop - length)[edge]) / np.maximum(length[edge], 1e-9)
    return ends[edge, 0] + share[:, None] * (ends[edge, 1] - ends[edge, 0]), edge
