"""What effects need to know of the surfaces in a depth image: how they are seen, where they end.

Along a plane the inverse of depth is linear in the pixel, however the plane lies. So both come
from differences of inverse depth: the first ones give normals, the second ones the edges.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from burg_drake.cameras.optics import FieldOfView, Intrinsics
from burg_drake.core import Booleans, Single

EDGE = 0.01
"""Second difference of inverse depth, as a share of it, from which on there is an edge. A step of a
hundredth of the depth has as much; where two planes at 75 degrees meet it is
2 tan(75 degrees) / f, below this for f above 750 pixels, and little above it at 400."""


def inverse_depth(depth: Single) -> Single:
    """(H, W) 1 / z [1/m]; 0 where nothing is."""
    return np.reciprocal(np.where(depth > 0.0, depth, np.float32(np.inf)))


def depth_edges(depth: Single) -> Booleans:
    """(H, W) pixels beside which, in their row or column, another surface or nothing is.

    Args:
        depth: (H, W) [m], 0 for none.
    """
    w = inverse_depth(depth)
    limit = np.float32(EDGE) * w
    edges = np.zeros(depth.shape, dtype=bool)
    for turned, bound, found in ((w, limit, edges), (w.T, limit.T, edges.T)):
        second = turned[:, :-2] + turned[:, 2:]
        second -= 2.0 * turned[:, 1:-1]
        found[:, 1:-1] |= np.abs(second, out=second) > bound[:, 1:-1]
    return edges & (depth > 0.0)


def incidence_angle(depth: Single, intrinsics: Intrinsics, normals: Single | None = None) -> Single:
    """(H, W) angle between a surface's normal and the ray that sees it [rad]; 0 where nothing is.

    Args:
        depth: (H, W) [m], 0 for none.
        intrinsics: of the camera.
        normals: (H, W, 3) unit normals in the camera's frame. If None, they are those of the depth
            image, without lens distortion.
    """
    if normals is None:
        cosine = _cosine_of_depth(inverse_depth(depth), intrinsics)
    else:
        products = cv2.multiply(np.asarray(normals, dtype=np.float32), _rays(intrinsics))
        cosine = np.abs(cv2.transform(products, np.ones((1, 3), np.float32)))
    angle: Single = np.arccos(np.minimum(cosine, np.float32(1.0)))
    return np.where(depth > 0.0, angle, np.float32(0.0))


def _cosine_of_depth(w: Single, intrinsics: Intrinsics) -> Single:
    """A plane n . X = 1 has w = n . r, with the ray r = X / z; so its slopes over the image are
    n_x / f_x and n_y / f_y, and the cosine between n and r is w / (|n| |r|)."""
    (fx, fy), (cx, cy) = intrinsics.focal, intrinsics.center
    x = ((np.arange(w.shape[1]) - cx) / fx).astype(np.float32)
    y = ((np.arange(w.shape[0])[:, None] - cy) / fy).astype(np.float32)
    nx = np.float32(fx) * _slope(w)
    ny = np.float32(fy) * _slope(np.ascontiguousarray(w.T)).T
    nz = w - nx * x
    nz -= ny * y
    squares = nx * nx
    squares += ny * ny
    squares += nz * nz
    squares *= x * x + y * y + np.float32(1.0)
    np.maximum(squares, np.float32(np.finfo(np.float32).tiny), out=squares)
    return np.asarray(w / np.sqrt(squares))


def _slope(w: Single) -> Single:
    """(H, W) change along the rows, per pixel: towards the neighbour on the same surface, which is
    the one with the smaller change."""
    steps = np.diff(w, axis=1)
    slope = np.empty_like(w)
    slope[:, 0], slope[:, 1:] = steps[:, 0], steps
    sizes = np.abs(steps)
    np.copyto(slope[:, 1:-1], steps[:, 1:], where=sizes[:, 1:] < sizes[:, :-1])
    return slope


@lru_cache(maxsize=2)
def _rays(intrinsics: Intrinsics) -> Single:
    """(H, W, 3) unit vectors along which pixels look, in the camera's frame."""
    directions = FieldOfView(intrinsics).directions
    lengths = np.linalg.norm(directions, axis=-1, keepdims=True)
    rays: Single = (directions / lengths).astype(np.float32)
    rays.setflags(write=False)
    return rays
