"""Where the edges of markers appear in an image by a pose, and how they move with the pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from burg_drake.cameras.optics import Intrinsics
from burg_drake.cameras.pose.edges import REACH, MarkerEdges
from burg_drake.core import Array

MARGIN = 8
"""Distance that an edge keeps from the image's border [pixels]."""
NEAREST = 1e-3
"""Distance before the camera from which on points count as seen [m]."""
LENS_STEP = 1e-4
"""For derivatives of the lens's distortion [-]."""


@dataclass(frozen=True, eq=False)
class EdgeViews:
    """Edges as a camera sees them, by a pose.

    Attributes:
        which: (N,) indices into the table of edges.
        at: (N, 2) middles in the image [pixels].
        across, along: (N, 2) gradients of u and v in the image [cells per pixel].
        motion: (N, 6) how far an edge moves along `across` [pixels] with a small rotation [rad] and
            translation [m] of the camera, both in S as in `BoardEstimate.covariance`.
        print: (N, 2) the same if the print is longer along y by a share and shorter by it along x,
            about S's origin; and if its markers are larger by a share, each about its middle
            [pixels].
        bloom: (N,) the same if light spreads, so that white grows by a pixel on all sides: 1 or -1.
    """

    which: NDArray[np.intp]
    at: Array
    across: Array
    along: Array
    motion: Array
    print: Array
    bloom: Array


def view_edges(
    edges: MarkerEdges,
    which: NDArray[np.intp],
    intrinsics: Intrinsics,
    X_SC: Array,
    bloom: float = 0.0,
) -> EdgeViews:
    """Projects edges, and leaves out those that are not in the image.

    Args:
        edges: table.
        which: of them, as indices.
        intrinsics: of the camera.
        X_SC: (4, 4) pose.
        bloom: by which white is larger on all sides [pixels].
    """
    R_SC = X_SC[:3, :3]
    q_S = edges.p_SE[which] - X_SC[:3, 3]
    p_CE = q_S @ R_SC
    keep = p_CE[:, 2] > NEAREST
    if not keep.all():
        which, q_S, p_CE = which[keep], q_S[keep], p_CE[keep]
    at, by_C = image_points(intrinsics, p_CE)
    margin = MARGIN + abs(bloom)
    limit = np.array([intrinsics.width, intrinsics.height]) - 1 - margin
    keep = np.asarray(((at > margin) & (at < limit)).all(axis=1))
    if not keep.all():
        which, q_S, at, by_C = which[keep], q_S[keep], at[keep], by_C[keep]
    by_S = by_C @ R_SC.T  # pixels per metre
    across, along = _cell_gradients(edges, which, by_S)
    normal = across / np.sqrt((across**2).sum(axis=1, keepdims=True))
    g = np.einsum("ni,nij->nj", normal, by_S)
    # p_CE = R_SC^T (p_SE - p_SC): a rotation w and translation d give R_SC^T (q x w - d).
    motion = np.hstack([cross(g, q_S), -g])
    aspect = g[:, 1] * edges.p_SE[which, 1] - g[:, 0] * edges.p_SE[which, 0]
    growth = (g * edges.from_center[which]).sum(axis=1)
    toward_black = -edges.steps[which, 1, REACH].astype(float)
    return EdgeViews(
        which,
        at + bloom * toward_black[:, None] * normal,
        across,
        along,
        motion,
        np.column_stack([aspect, growth]),
        toward_black,
    )


def motion_of_points(intrinsics: Intrinsics, X_SC: Array, p_S: Array) -> tuple[Array, Array]:
    """Image points (N, 2) of points (N, 3), and (N, 2, 6) how they move with a small rotation and
    translation of the camera, as in `BoardEstimate.covariance`. Points behind it are anywhere."""
    q_S = p_S - X_SC[:3, 3]
    p_C = q_S @ X_SC[:3, :3]
    ahead = p_C[:, 2:] > NEAREST
    at, by_C = image_points(intrinsics, np.where(ahead, p_C, [0.0, 0.0, 1.0]))
    by_S = by_C @ X_SC[:3, :3].T
    return at, np.concatenate([cross(by_S, q_S[:, None]), -by_S], axis=2)


def predicted_places(
    p_SQ: Array, intrinsics: Intrinsics, X_SC: Array, covariance: Array
) -> tuple[Array, Array]:
    """Places (..., 2) in the image of points (..., 3) [pixels], and their variance (...) along the
    larger axis [pixels^2]: infinite for points behind the camera."""
    p_S = p_SQ.reshape(-1, 3)
    ahead = (p_S - X_SC[:3, 3]) @ X_SC[:3, 2] > NEAREST
    at, motion = motion_of_points(intrinsics, X_SC, p_S)
    spread = motion @ covariance @ motion.transpose(0, 2, 1)
    variance = np.where(ahead, np.linalg.eigvalsh(spread)[:, -1], np.inf)
    return at.reshape(*p_SQ.shape[:-1], 2), variance.reshape(p_SQ.shape[:-1])


def perturbed_pose(X_SC: Array, step: Array, p_SA: Array | None = None) -> Array:
    """A pose after a small rotation and translation (6,), see `BoardEstimate.covariance`.

    Args:
        X_SC: (4, 4) pose.
        step: (6,) rotation [rad] and translation [m].
        p_SA: (3,) point about which the rotation turns the camera, shifted before; the camera
            itself if None. To first order it makes no difference; a point in the middle of what is
            seen makes longer steps hold.
    """
    R = Rotation.from_rotvec(step[:3]).as_matrix()
    X = np.eye(4)
    X[:3, :3] = R @ X_SC[:3, :3]
    if p_SA is None:
        X[:3, 3] = X_SC[:3, 3] + step[3:]
    else:
        arm = X_SC[:3, 3] - p_SA
        X[:3, 3] = p_SA + R @ (arm + step[3:] - np.cross(step[:3], arm))
    return X


def image_points(intrinsics: Intrinsics, p_CQ: Array) -> tuple[Array, Array]:
    """Image points (N, 2) and their derivatives (N, 2, 3) by the points in the camera's frame."""
    x = p_CQ[:, :2] / p_CQ[:, 2:]
    by_C = np.zeros((len(x), 2, 3))
    by_C[:, 0, 0] = by_C[:, 1, 1] = 1.0 / p_CQ[:, 2]
    by_C[:, :, 2] = -x / p_CQ[:, 2:]
    if intrinsics.is_pinhole:
        focal = np.array(intrinsics.focal)
        return x * focal + intrinsics.center, by_C * focal[:, None]
    points = np.ones((3, len(x), 3))
    points[:, :, :2] = x
    points[1, :, 0] += LENS_STEP
    points[2, :, 1] += LENS_STEP
    at, right, down = intrinsics.project(points)
    return at, np.stack([right - at, down - at], axis=2) / LENS_STEP @ by_C


def cross(a: Array, b: Array) -> Array:
    """Vector products (..., 3), as `numpy.cross` in a third of its time for few vectors."""
    (ax, ay, az), (bx, by, bz) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def _cell_gradients(
    edges: MarkerEdges, which: NDArray[np.intp], by_S: Array
) -> tuple[Array, Array]:
    """Gradients of u and v [cells per pixel]: the inverse of the sheet's affine map to pixels."""
    cell = by_S[:, :, :2] * edges.cell
    det = cell[:, 0, 0] * cell[:, 1, 1] - cell[:, 0, 1] * cell[:, 1, 0]
    x = np.column_stack([cell[:, 1, 1], -cell[:, 0, 1]]) / det[:, None]
    y = np.column_stack([-cell[:, 1, 0], cell[:, 0, 0]]) / det[:, None]
    is_x = (edges.axis[which] == 0)[:, None]
    return np.where(is_x, x, y), np.where(is_x, y, x)
