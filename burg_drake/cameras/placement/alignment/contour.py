"""Points on the outline of a displaced object, as a camera sees it, and how they move with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.placement.alignment.pinhole import NEAR, PinholeView, sample_nearest
from burg_drake.cameras.placement.alignment.shape import TargetShape
from burg_drake.core import Array, inverse, transform_points

SPACING = 1.5
"""Between points along the outline [pixels]."""
BESIDE = np.array([0.6, 1.2, -0.6])
"""Where, outwards from a point on the outline, all must be free, free and covered [pixels]."""
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

    def inside(self, pixels: Array) -> NDArray[np.bool_]:
        """Which (...,) of some image points (..., 2) the object itself covers."""
        return np.isfinite(self.view.cast(self.shape, self.q, pixels))


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
