"""Lines and surfaces of a scene as a camera sees them, computed with rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.intrinsics import NEAR_DISTANCE, FieldOfView
from burg_drake.cameras.scene_mesh import SceneMesh
from burg_drake.core import Array, Booleans, Bytes, Indices, inverse, transform_points

OUTLINE_KIND = 0  # A contour in front of another object or of nothing.
INNER_KIND = 1  # A contour in front of another part of the same object.
CREASE_KIND = 2  # A sharp edge of an object.


@dataclass(frozen=True, eq=False)
class VisibleLines:
    """Visible pieces of a scene's lines.

    Attributes:
        ends: (N, 2, 2) ends of the pieces [pixels].
        owner: (N,) number of each piece's instance.
        kind: (N,) `OUTLINE_KIND`, `INNER_KIND` or `CREASE_KIND`.
    """

    ends: Array
    owner: Indices
    kind: Indices


def visible_lines(shape: SceneMesh, view: FieldOfView, X_SC: Array) -> VisibleLines:
    """Finds the visible lines of a scene.

    Args:
        shape: mesh of the scene.
        view: field of view of the camera.
        X_SC: (4, 4) camera's optical frame in the scene frame.
    """
    outline, X_CS = shape.outline, inverse(X_SC)
    contour = outline.contour(X_SC[:3, 3])
    creases = outline.creases
    creases = creases[outline.front(X_SC[:3, 3], outline.sides[creases]).all(axis=1)]
    edges = np.concatenate([contour.edges, creases])
    faces = np.concatenate([contour.faces, outline.sides[creases, 0]])
    kind = np.repeat([OUTLINE_KIND, CREASE_KIND], [len(contour.edges), len(creases)])
    p_CQ = transform_points(X_CS, outline.vertices[outline.edges[edges]])
    inside = transform_points(X_CS, outline.vertices[outline.faces[faces]]).mean(axis=1)
    p_CQ, parts = clip_lines(p_CQ, view)
    faces, inside, kind = faces[parts], inside[parts], kind[parts]
    seen, kind = _find_visible(shape, view, X_SC, p_CQ, inside, kind, shape.owner[faces])
    return VisibleLines(view.intrinsics.project(p_CQ[seen]), shape.owner[faces[seen]], kind[seen])


def clip_lines(p_CQ: Array, view: FieldOfView) -> tuple[Array, Indices]:
    """Clips lines to the view and splits them into short pieces, which follow the lens distortion.

    Args:
        p_CQ: (N, 2, 3) ends of the lines in the camera's frame [m].
        view: field of view of the camera.

    Returns:
        (M, 2, 3) ends of the pieces, and (M,) indices of their lines.
    """
    depth = p_CQ[..., 2]
    line = np.flatnonzero((depth > NEAR_DISTANCE).any(axis=1))
    p_CQ, depth = p_CQ[line], depth[line]
    behind = np.flatnonzero((depth <= NEAR_DISTANCE).any(axis=1))
    if len(behind):
        a, b = p_CQ[behind, 0], p_CQ[behind, 1]
        cut = a + ((NEAR_DISTANCE * 1.001 - a[:, 2:]) / (b[:, 2:] - a[:, 2:])) * (b - a)
        p_CQ[behind] = np.where(
            (depth[behind] <= NEAR_DISTANCE)[..., None], cut[:, None], p_CQ[behind]
        )
    flat = p_CQ[..., :2] / p_CQ[..., 2:] * view.intrinsics.focal
    length = np.linalg.norm(flat[:, 1] - flat[:, 0], axis=1)
    # Pixels. Longer lines are split; each piece is visible or hidden as a whole.
    count = np.maximum(np.ceil(length / 3.0), 1).astype(int)
    part = np.repeat(np.arange(len(count)), count)
    step = np.arange(len(part)) - np.repeat(np.cumsum(count) - count, count)
    # Even steps in the image, so that pieces near the camera are not longer than others.
    share = np.stack([step, step + 1], axis=1) / count[part, None]
    near, far = p_CQ[part, 0, 2][:, None], p_CQ[part, 1, 2][:, None]
    share = share * near / (share * near + (1.0 - share) * far)
    ends = p_CQ[part, :1] + share[..., None] * (p_CQ[part, 1:] - p_CQ[part, :1])
    kept = view.sees(ends).all(axis=1)
    return ends[kept], line[part[kept]]


def _find_visible(
    shape: SceneMesh,
    view: FieldOfView,
    X_SC: Array,
    p_CQ: Array,
    inside: Array,
    kind: Indices,
    owner: Indices,
) -> tuple[Booleans, Indices]:
    """(N,) True for visible pieces, and (N,) the kinds of all pieces.

    Args:
        inside: (N, 3) points of the surface beside each piece, in C.
    """
    if not len(p_CQ):
        return np.zeros(0, bool), kind
    middle = p_CQ.mean(axis=1)
    across = np.cross(p_CQ[:, 1] - p_CQ[:, 0], middle)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-15)
    outward = -np.sign(np.einsum("ij,ij->i", across, inside))
    pixel = middle[:, 2] / max(view.intrinsics.focal)
    # A ray passes a contour at a distance of 0.1 pixels.
    gap = np.where(kind == CREASE_KIND, 0.0, 0.1 * pixel * outward)
    target = middle + gap[:, None] * across
    distance = np.linalg.norm(target, axis=1)
    directions = (target / distance[:, None]) @ X_SC[:3, :3].T
    origins = np.broadcast_to(X_SC[:3, 3], directions.shape)
    face, hit = shape.rays.first_hits(origins, directions)
    seen = hit > distance - 5e-5  # Metres; rays have single precision.
    own = (face >= 0) & (shape.owner[face] == owner)
    inner = own & (kind == OUTLINE_KIND)
    # Metres behind an inner contour; less is a bump of a scan.
    seen &= ~inner | (hit > distance + 2e-3)
    return seen, np.where(inner, INNER_KIND, kind)


RAY_SPACING_PX = 4
"""Pixels between coarse rays, in rows and columns."""
NO_OWNER = -1  # Owner of pixels that show no object.


@dataclass(frozen=True, eq=False)
class SurfaceImage:
    """Instance and shade of each pixel.

    Attributes:
        owner: (H, W) number of the instance, `NO_OWNER` for none.
        shade: (H, W) brightness of the surface as bytes; 0 for none.
    """

    owner: NDArray[np.int16]
    shade: Bytes


class SurfaceCamera:
    """Renders the surfaces of a scene.

    Attributes:
        shape: mesh of the scene.
    """

    def __init__(self, shape: SceneMesh, view: FieldOfView) -> None:
        self.shape = shape
        directions = view.directions
        self._directions = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
        self._size = directions.shape[:2]
        rows, columns = (
            np.minimum(np.arange(0, n + RAY_SPACING_PX, RAY_SPACING_PX), n - 1) for n in self._size
        )
        # One node more than blocks in each direction; the last may be closer.
        blocks = [-(-n // RAY_SPACING_PX) for n in self._size]
        self._nodes = np.ix_(rows[: blocks[0] + 1], columns[: blocks[1] + 1])
        self._x, self._y = np.moveaxis(directions[self._nodes][..., :2], 2, 0).copy()

    def render(self, X_SC: Array, lines: VisibleLines, shades: Bytes) -> SurfaceImage:
        """Renders the surfaces from a pose of the camera.

        Args:
            X_SC: (4, 4) camera's optical frame in the scene frame.
            lines: visible lines from that pose, see `visible_lines`.
            shades: (F,) brightness of each face.
        """
        owner, shade = self._render_nodes(X_SC, shades)
        corners = np.stack([owner[:-1, :-1], owner[:-1, 1:], owner[1:, :-1], owner[1:, 1:]])
        mixed = (corners != corners[0]).any(axis=0) | self._outline_blocks(lines)
        whole = corners[0].repeat(RAY_SPACING_PX, axis=0).repeat(RAY_SPACING_PX, axis=1)
        seen = np.ascontiguousarray(whole[: self._size[0], : self._size[1]])
        image = SurfaceImage(seen, self._interpolate(shade))
        image.shade[image.owner == NO_OWNER] = 0
        blocks = np.argwhere(mixed)
        within = np.argwhere(np.ones((RAY_SPACING_PX, RAY_SPACING_PX)))[None]
        pixels = (blocks[:, None] * RAY_SPACING_PX + within).reshape(-1, 2)
        pixels = pixels[(pixels < self._size).all(axis=1)]
        at = pixels[:, 0], pixels[:, 1]
        image.owner[at], image.shade[at] = self._cast(X_SC, self._directions[at], shades)
        return image

    def _render_nodes(self, X_SC: Array, shades: Bytes) -> tuple[NDArray[np.int16], Bytes]:
        """Owner and shade at the nodes; rays are cast only near objects."""
        candidates = self._candidate_nodes(X_SC)
        owner = np.full(candidates.shape, NO_OWNER, np.int16)
        shade = np.zeros(candidates.shape, np.uint8)
        directions = self._directions[self._nodes][candidates]
        owner[candidates], shade[candidates] = self._cast(X_SC, directions, shades)
        return owner, shade

    def _candidate_nodes(self, X_SC: Array) -> Booleans:
        """True for nodes in the image rectangle around the bounding box of an instance."""
        candidates = np.zeros(self._x.shape, bool)
        X_CS = inverse(X_SC)
        for lower, upper in self.shape.boxes:
            corners = np.stack(np.meshgrid(*np.stack([lower, upper], axis=1)), -1).reshape(-1, 3)
            p_CQ = transform_points(X_CS, corners)
            if (p_CQ[:, 2] < NEAR_DISTANCE).all():
                continue
            if (p_CQ[:, 2] < NEAR_DISTANCE).any():
                return np.ones_like(candidates)
            seen = p_CQ[:, :2] / p_CQ[:, 2:]
            (left, top), (right, bottom) = seen.min(axis=0), seen.max(axis=0)
            within = (self._x >= left) & (self._x <= right)
            candidates |= within & (self._y >= top) & (self._y <= bottom)
        return candidates

    def _cast(
        self, X_SC: Array, directions: Array, shades: Bytes
    ) -> tuple[NDArray[np.int16], Bytes]:
        """Owner and shade of the surfaces that rays (..., 3) in C hit."""
        flat, size = directions.reshape(-1, 3) @ X_SC[:3, :3].T, directions.shape[:-1]
        if not len(flat):
            return np.empty(size, np.int16), np.empty(size, np.uint8)
        face, _ = self.shape.rays.first_hits(np.broadcast_to(X_SC[:3, 3], flat.shape), flat)
        missed = face < 0
        owner = np.where(missed, NO_OWNER, self.shape.owner[face]).astype(np.int16)
        shade = np.where(missed, 0, shades[face]).astype(np.uint8)
        return owner.reshape(size), shade.reshape(size)

    def _outline_blocks(self, lines: VisibleLines) -> Booleans:
        """True for blocks within a pixel of an outline."""
        rows, columns = (-(-n // RAY_SPACING_PX) for n in self._size)
        crossed = np.zeros((rows, columns), bool)
        points = lines.ends[lines.kind == OUTLINE_KIND].reshape(-1, 2)
        for shift in ((-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)):
            column, row = np.floor((points + np.array(shift)) / RAY_SPACING_PX).astype(int).T
            kept = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
            crossed[row[kept], column[kept]] = True
        return crossed

    def _interpolate(self, shade: Bytes) -> Bytes:
        """Interpolates shades between the nodes."""
        import cv2

        scale = np.array([[RAY_SPACING_PX, 0.0, 0.0], [0.0, RAY_SPACING_PX, 0.0]])
        height, width = self._size
        spread = cv2.warpAffine(
            shade, scale, (width, height), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        return np.asarray(spread, np.uint8)
