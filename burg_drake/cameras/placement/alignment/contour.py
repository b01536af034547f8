"""Points on the outline of a displaced object, as a camera sees it, and how they move with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.placement.alignment.pinhole import NEAR, PinholeView, sample_nearest
from burg_drake.cameras.placement.alignment.shape import TargetShape
from burg_drake.core import Array, inverse, transform_points

SPACING = 2.0
"""Between points along the outline [pixels]."""
BESIDE = np.array([0.6, 1.2, -0.6])
"""Where, outwards from a point on the outline, all must be free, free and covered [pixels]."""
CREASE = 0.82
"""Least cosine between the normals of points that get similar light."""
RIM = 0.25
"""From how far inside an outline on normals are compared [pixels]."""
SOON = 2.5
"""How far inside they are [pixels]."""
MATERIAL = 0.08
"""Difference of reflectance from which on two points are of different materials."""
EDGE_DEPTH = 2e-3
"""What is nearer by this much than a point on the outline hides it [m]."""


@dataclass(frozen=True, eq=False)
class ImageContour:
    """Points on an outline.

    Attributes:
        pixels: (N, 2) in the image.
        normals: (N, 2) unit vectors in the image, out of the object.
        p_SQ: (N, 3) where they are [m].
        along: (N, 3) pixels along the normal per x, y [m] and angle [rad] of the displacement.
        camera: (N, 6) pixels along the normal per error of the camera, as `BoardEstimate` has it:
            rotation [rad], then translation [m].
        view, shape, q: whose outline.
    """

    pixels: Array
    normals: Array
    p_SQ: Array
    along: Array
    camera: Array
    view: PinholeView
    shape: TargetShape
    q: Array

    def __len__(self) -> int:
        return len(self.pixels)

    def points(self, offsets: Array) -> Array:
        """(N, T, 2) points on the normals, at distances (T,) from the outline [pixels]."""
        return self.pixels[:, None] + offsets[:, None] * self.normals[:, None]

    def inside(self, pixels: Array, t: Array) -> tuple[NDArray[np.bool_], Array, Array]:
        """What the object covers of points (N, T, 2) on the normals.

        Args:
            pixels: the points.
            t: (T,) their distances from the outline, rising.

        Returns:
            (N, T) whether it covers them; (N,) at which distance the surface that begins at the
            outline ends inwards, -infinity if it does not: at a bend, another material, or where
            it hides another part; and (N, 3) its reflectance over that of what begins there.
        """
        face, depth = self.view.hits(self.shape, self.q, pixels)
        covered = np.isfinite(depth)
        normal, colors = self.shape.normals[face], self.shape.colors
        color = np.full((*face.shape, 3), 0.5) if colors is None else colors[face]
        both = covered[:, 1:] & covered[:, :-1] & (t[1:] <= 0.0)
        middle = (t[1:] + t[:-1]) / 2
        other = np.abs(np.diff(color, axis=1)).max(axis=-1) > MATERIAL
        p = self.view.points(self.shape, self.q, pixels, np.where(covered, depth, 1.0))
        away = np.diff(p, axis=1)
        here, before = (np.einsum("nti,nti->nt", n, away) for n in (normal[:, 1:], normal[:, :-1]))
        other |= np.minimum(np.abs(here), np.abs(before)) > 2.0 * EDGE_DEPTH
        strip = np.where(other & both, middle, -np.inf).max(axis=1)
        last = np.argmax(np.where(covered & (t <= -RIM), t, -np.inf), axis=1)
        begin = normal[np.arange(len(last)), last]
        turned = np.einsum("nti,ni->nt", normal[:, :-1], begin) < CREASE
        turned &= both & (middle > -SOON)
        bend = np.where(turned, middle, -np.inf).max(axis=1)
        strip = np.where(np.isfinite(strip), strip, bend)
        line = np.arange(len(strip))
        deep = np.maximum(np.searchsorted(t, np.where(np.isfinite(strip), strip, t[0])) - 2, 0)
        deep = np.where(covered[line, deep] & np.isfinite(strip), deep, last)
        tone = np.maximum(color[line, last], 0.01) / np.maximum(color[line, deep], 0.01)
        return covered, strip, tone


def outline(view: PinholeView, shape: TargetShape, q: Array, others: Array) -> ImageContour:
    """The outline of a displaced object, where it is in the image and nothing hides it.

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
    p_SQ, edge = _along(view, ends)
    p_CQ, pixels = view.project(p_SQ)
    _, e = view.project(ends.reshape(-1, 3))
    e = e.reshape(-1, 2, 2)
    _, m = view.project(third)
    normal_C = e[:, 1] - e[:, 0]
    normal = np.stack([normal_C[:, 1], -normal_C[:, 0]], axis=1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
    inward = np.einsum("ni,ni->n", normal, m - e[:, 0])
    normal = (normal * np.where(inward > 0.0, -1.0, 1.0)[:, None])[edge]
    kept = (p_CQ[:, 2] > NEAR) & ((pixels >= 0.0) & (pixels <= np.array(view.size) - 1.0)).all(1)
    kept &= sample_nearest(others, pixels, np.inf) > p_CQ[:, 2] - EDGE_DEPTH
    beside = pixels[kept, None] + BESIDE[:, None] * normal[kept, None]
    covered = np.isfinite(view.cast(shape, q, beside))
    kept[kept] = ~covered[:, 0] & ~covered[:, 1] & covered[:, 2]
    p_SQ, pixels, normal = p_SQ[kept], pixels[kept], normal[kept]
    J = np.einsum("ni,nij->nj", normal, view.jacobian(p_SQ))
    arm = p_SQ - shape.p_SR - (q[0], q[1], 0.0)
    turn = arm[:, 0] * J[:, 1] - arm[:, 1] * J[:, 0]
    moved = np.concatenate([-np.cross(p_SQ - view.X_SC[:3, 3], J), -J], axis=1)
    along = np.column_stack([J[:, 0], J[:, 1], turn])
    return ImageContour(pixels, normal, p_SQ, along, moved, view, shape, q)


def _along(view: PinholeView, ends: Array) -> tuple[Array, NDArray[np.int64]]:
    """Points (N, 3) spaced evenly over segments (E, 2, 3) as the image has them; whose they are."""
    _, pixels = view.project(ends.reshape(-1, 3))
    pixels = pixels.reshape(-1, 2, 2)
    length = np.linalg.norm(pixels[:, 1] - pixels[:, 0], axis=1)
    length = np.where((pixels.max(axis=1) < 0).any(axis=1), 0.0, np.minimum(length, 1e4))
    stop = np.cumsum(length)
    at = np.arange(SPACING / 2, stop[-1] if len(stop) else 0.0, SPACING)
    edge = np.searchsorted(stop, at)
    share = (at - (stop - length)[edge]) / np.maximum(length[edge], 1e-9)
    return ends[edge, 0] + share[:, None] * (ends[edge, 1] - ends[edge, 0]), edge
