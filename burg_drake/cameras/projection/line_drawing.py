"""The lines of a scene as a camera sees them: outlines, inner contours and creases, hidden parts
left out.

Contour edges are projected as they are, so that lines are where the surface ends, to fractions of a
pixel. Whether a bit of contour can be seen, and what lies behind it, is one ray that passes it by a
tenth of a pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.optics import NEAR, FieldOfView
from burg_drake.cameras.projection.scene_mesh import SceneMesh
from burg_drake.core import Array, Indices, inverse, transform_points

OUTLINE, INNER, CREASE = 0, 1, 2
"""Kinds of lines: behind which lies another object or nothing; the same object; an edge."""

BIT = 3.0
"""Lines are cut into bits not longer than this, which are seen or hidden as a whole [pixels]."""
PASSING = 0.1
"""Distance at which a ray passes a bit of contour [pixels]."""
STEP = 2e-3
"""An inner contour is a line when the surface behind is this much further away, at least: bumps of
a scan are none [m]."""
SLACK = 5e-5
"""What is nearer than a line by less does not hide it, as rays have single precision [m]."""


@dataclass(frozen=True, eq=False)
class VisibleLines:
    """Bits of lines that a camera sees.

    Attributes:
        ends: (N, 2, 2) in the image [pixels].
        p_CQ: (N, 2, 3) the same in the camera's frame [m].
        owner: (N,) number of the instance.
        kind: (N,) `OUTLINE`, `INNER` or `CREASE`.
    """

    ends: Array
    p_CQ: Array
    owner: Indices
    kind: Indices


def visible_lines(shape: SceneMesh, view: FieldOfView, X_SC: Array) -> VisibleLines:
    """The lines of a scene that a camera sees.

    Args:
        shape: of the scene.
        view: the camera's.
        X_SC: (4, 4) camera's optical frame in the scene frame.
    """
    outline, X_CS = shape.outline, inverse(X_SC)
    contour = outline.contour(X_SC[:3, 3])
    creases = outline.creases
    creases = creases[outline.front(X_SC[:3, 3], outline.sides[creases]).all(axis=1)]
    edges = np.concatenate([contour.edges, creases])
    faces = np.concatenate([contour.faces, outline.sides[creases, 0]])
    kind = np.repeat([OUTLINE, CREASE], [len(contour.edges), len(creases)])
    p_CQ = transform_points(X_CS, outline.vertices[outline.edges[edges]])
    inside = transform_points(X_CS, outline.vertices[outline.faces[faces]]).mean(axis=1)
    p_CQ, parts = clip_lines(p_CQ, view)
    faces, inside, kind = faces[parts], inside[parts], kind[parts]
    seen, kind = _seen(shape, view, X_SC, p_CQ, inside, kind, shape.owner[faces])
    p_CQ, kind, owner = p_CQ[seen], kind[seen], shape.owner[faces[seen]]
    return VisibleLines(view.intrinsics.project(p_CQ), p_CQ, owner, kind)


def clip_lines(p_CQ: Array, view: FieldOfView) -> tuple[Array, Indices]:
    """Lines cut to what is in view, and into short bits, which follow a lens where it bends them.

    Args:
        p_CQ: (N, 2, 3) ends of the lines in the camera's frame [m].
        view: the camera's.

    Returns:
        (M, 2, 3) ends of the bits, and (M,) the line that each is of.
    """
    depth = p_CQ[..., 2]
    line = np.flatnonzero((depth > NEAR).any(axis=1))
    p_CQ, depth = p_CQ[line], depth[line]
    behind = np.flatnonzero((depth <= NEAR).any(axis=1))
    if len(behind):
        a, b = p_CQ[behind, 0], p_CQ[behind, 1]
        cut = a + ((NEAR * 1.001 - a[:, 2:]) / (b[:, 2:] - a[:, 2:])) * (b - a)
        p_CQ[behind] = np.where((depth[behind] <= NEAR)[..., None], cut[:, None], p_CQ[behind])
    flat = p_CQ[..., :2] / p_CQ[..., 2:] * view.intrinsics.focal
    length = np.linalg.norm(flat[:, 1] - flat[:, 0], axis=1)
    count = np.maximum(np.ceil(length / BIT), 1).astype(int)
    part = np.repeat(np.arange(len(count)), count)
    step = np.arange(len(part)) - np.repeat(np.cumsum(count) - count, count)
    # Even steps in the image, so that bits near the camera are not longer than others.
    share = np.stack([step, step + 1], axis=1) / count[part, None]
    near, far = p_CQ[part, 0, 2][:, None], p_CQ[part, 1, 2][:, None]
    share = share * near / (share * near + (1.0 - share) * far)
    ends = p_CQ[part, :1] + share[..., None] * (p_CQ[part, 1:] - p_CQ[part, :1])
    kept = view.sees(ends).all(axis=1)
    return ends[kept], line[part[kept]]


def _seen(
    shape: SceneMesh,
    view: FieldOfView,
    X_SC: Array,
    p_CQ: Array,
    inside: Array,
    kind: Indices,
    owner: Indices,
) -> tuple[NDArray[np.bool_], Indices]:
    """Which bits are seen, and their kinds.

    Args:
        inside: (N, 3) points of the surface beside each bit, in C.
    """
    if not len(p_CQ):
        return np.zeros(0, bool), kind
    middle = p_CQ.mean(axis=1)
    across = np.cross(p_CQ[:, 1] - p_CQ[:, 0], middle)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-15)
    outward = -np.sign(np.einsum("ij,ij->i", across, inside))
    pixel = middle[:, 2] / max(view.intrinsics.focal)
    passing = np.where(kind == CREASE, 0.0, PASSING * pixel * outward)
    target = middle + passing[:, None] * across
    distance = np.linalg.norm(target, axis=1)
    directions = (target / distance[:, None]) @ X_SC[:3, :3].T
    origins = np.broadcast_to(X_SC[:3, 3], directions.shape)
    face, hit = shape.rays.first_hits(origins, directions)
    seen = hit > distance - SLACK
    own = (face >= 0) & (shape.owner[face] == owner)
    inner = own & (kind == OUTLINE)
    seen &= ~inner | (hit > distance + STEP)
    return seen, np.where(inner, INNER, kind)
