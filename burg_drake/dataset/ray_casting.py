"""Exact depth, labels, normals and silhouettes from rays through the pixel centres."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras import NEAR_DISTANCE, Intrinsics
from burg_drake.core import Array, Indices, Single, inverse, transform_points
from burg_drake.dataset.camera_rays import PixelBox, camera_rays
from burg_drake.dataset.sample import SURROUNDINGS_LABEL, Images, box_of_mask
from burg_drake.dataset.views import View
from burg_drake.geometry import RayCaster


def pixels_around(
    p_CQ: Array, faces: Indices, intrinsics: Intrinsics, *, beyond: bool = False
) -> PixelBox | None:
    """Rectangle of pixels that contains the image of a surface.

    Args:
        p_CQ: (V, 3) vertices of the surface in the camera's frame [m].
        faces: (F, 3) triangles of the surface.
        intrinsics: intrinsics of the camera.
        beyond: whether the rectangle may exceed the image by one image size at each edge.
            Ignored with lens distortion, whose model holds only within the image.

    Returns:
        The rectangle; None if no pixel can show the surface.
    """
    in_front = p_CQ[:, 2] >= NEAR_DISTANCE
    if not in_front.all():
        p_CQ = _clip_at_near_plane(p_CQ, faces, in_front)
    if not len(p_CQ):
        return None
    slopes = p_CQ[:, :2] / p_CQ[:, 2:]
    lower, upper = slopes.min(axis=0), slopes.max(axis=0)
    if not intrinsics.is_pinhole:
        return camera_rays(intrinsics).pixel_box(lower, upper)
    size = np.array([intrinsics.width, intrinsics.height])
    reach = size if beyond else 0
    low = np.maximum(-reach, np.floor(lower * intrinsics.focal + intrinsics.center))
    high = np.minimum(size + reach, np.ceil(upper * intrinsics.focal + intrinsics.center) + 1.0)
    if (low >= high).any():
        return None
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def _clip_at_near_plane(p_CQ: Array, faces: Indices, in_front: np.ndarray) -> Array:
    """Points in front of the camera, and the points where edges cross its near plane."""
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    a, b = p_CQ[edges[in_front[edges[:, 0]] != in_front[edges[:, 1]]].T]
    share = (NEAR_DISTANCE - a[:, 2:]) / (b[:, 2:] - a[:, 2:])
    return np.asarray(np.concatenate([p_CQ[in_front], a + share * (b - a)]))


BOX_NORMALS = np.concatenate([-np.eye(3), np.eye(3)])
"""(6, 3) outward normals of a box: lower x, y, z, then upper x, y, z."""
SURFACE_TOLERANCE = 1e-9
"""Metres; smaller dimensions of a surface count as 0."""


@dataclass(frozen=True, eq=False)
class RayBox:
    """A box or rectangle aligned with the axes of its frame.

    Attributes:
        lower, upper: (3,) corners [m].
    """

    lower: Array
    upper: Array

    @classmethod
    def of_surface(cls, vertices: Array, faces: Indices) -> RayBox | None:
        """The box that triangles form, however they divide its faces; None for other shapes.

        Args:
            vertices: (V, 3) vertices [m].
            faces: (F, 3) triangles.
        """
        lower, upper = vertices.min(axis=0), vertices.max(axis=0)
        size = upper - lower
        sides = np.minimum(np.abs(vertices - lower), np.abs(vertices - upper)) <= SURFACE_TOLERANCE
        area = np.prod(np.sort(size)[1:])
        if size.min() > SURFACE_TOLERANCE:
            area = 2.0 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0])
        a, b, c = vertices[faces].transpose(1, 0, 2)
        found = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
        if not sides.any(axis=1).all() or abs(found - area) > 1e-6 * area:
            return None
        return cls(lower, upper)

    def inverse_depth(self, intrinsics: Intrinsics, X_CB: Array) -> Single | None:
        """(H, W) inverse depth 1 / z [1/m] at which a camera's rays hit the box, 0 for a miss; None
        if the camera is inside the box or in the plane of a face.

        In the camera's frame, a ray along (x, y, 1) meets the plane n . p = d at 1 / z =
        n . (x, y, 1) / d, which is linear in x and y. The ray enters the box where 1 / z is least
        among the planes that the camera sees from outside, if it leaves by no other plane before.
        """
        enter: Single | None = None
        leave: Single | None = None
        distances = self._distances(X_CB)
        if (distances >= 0.0).all() or (np.abs(distances) < SURFACE_TOLERANCE).any():
            return None
        for number, image in self._plane_images(intrinsics, X_CB):
            if distances[number] > 0.0:
                leave = image if leave is None else np.maximum(leave, image, out=leave)
            else:
                enter = image if enter is None else np.minimum(enter, image, out=enter)
        assert enter is not None and leave is not None
        enter[enter < np.maximum(leave, 0.0, out=leave)] = 0.0
        return enter

    def entered_planes(self, intrinsics: Intrinsics, X_CB: Array) -> NDArray[np.int16]:
        """(H, W) index in `BOX_NORMALS` of the face that each ray enters; arbitrary for a miss."""
        enter: Single | None = None
        found = np.zeros((intrinsics.height, intrinsics.width), np.int16)
        distances = self._distances(X_CB)
        for number, image in self._plane_images(intrinsics, X_CB):
            if distances[number] < 0.0:
                if enter is None:
                    enter = image
                    found[:] = number
                else:
                    np.copyto(found, number, where=image < enter)
                    np.minimum(enter, image, out=enter)
        return found

    def _distances(self, X_CB: Array) -> Array:
        """(6,) distances of the camera from the planes of the faces, negative outside [m]."""
        offsets: Array = np.concatenate([-self.lower, self.upper])
        return offsets - BOX_NORMALS @ inverse(X_CB)[:3, 3]

    def _plane_images(self, intrinsics: Intrinsics, X_CB: Array) -> Iterator[tuple[int, Single]]:
        """Index of each plane in `BOX_NORMALS`, and the (H, W) inverse depth at which rays meet it,
        negative behind the camera."""
        x, y = camera_rays(intrinsics).slopes
        planes = BOX_NORMALS @ X_CB[:3, :3].T / self._distances(X_CB)[:, None]
        for number, (a, b, c) in enumerate(planes.astype(np.float32)):
            yield number, (a * x + c) + b * y


NO_FACE = -1
"""Face number of a ray that hits nothing."""


@dataclass(frozen=True, eq=False)
class SurfaceHits:
    """Hits of the rays through a rectangle of pixels on one surface.

    Attributes:
        pixels: the rectangle.
        unit: (N, 3) unit directions of the rays in the camera's frame, row by row.
        face: (h, w) index of the face that each ray hits, `NO_FACE` for a miss.
        depth: (h, w) depth along the optical axis [m], infinite for a miss.
    """

    pixels: PixelBox
    unit: Single
    face: NDArray[np.int32]
    depth: Single


class RaySurface:
    """A triangle mesh with one label.

    Attributes:
        label: label of the pixels that show the surface.
        box: the box that the triangles form; None for other shapes.
    """

    def __init__(self, label: int, vertices: Array, faces: Indices) -> None:
        """Stores the mesh.

        Args:
            label: label of the pixels that show the surface.
            vertices: (V, 3) vertices in the body's frame [m].
            faces: (F, 3) triangles, F >= 1.
        """
        self.label = label
        self._vertices, self._faces = vertices, faces
        self.box = RayBox.of_surface(vertices, faces)

    def cast_rays(
        self, intrinsics: Intrinsics, X_CB: Array, *, beyond: bool = False
    ) -> SurfaceHits | None:
        """Hits of a camera's rays; None if no pixel can show the surface.

        Args:
            intrinsics: intrinsics of the camera.
            X_CB: (4, 4) pose of the body in the camera's frame.
            beyond: whether to cast rays beyond the image's edges, see `pixels_around`.
        """
        p_CQ = transform_points(X_CB, self._vertices)
        pixels = pixels_around(p_CQ, self._faces, intrinsics, beyond=beyond)
        if pixels is None:
            return None
        unit = camera_rays(intrinsics).unit_in(pixels)
        R_BC = X_CB[:3, :3].T
        face, distance = self._rays.seen_from(-R_BC @ X_CB[:3, 3], _rotate_vectors(unit, R_BC))
        distance *= unit[:, 2]
        distance[face == NO_FACE] = np.inf
        shape = pixels[3] - pixels[1], pixels[2] - pixels[0]
        return SurfaceHits(pixels, unit, face.reshape(shape), distance.reshape(shape))

    def normals(self, hits: SurfaceHits, X_CB: Array) -> Single:
        """(h, w, 3) unit normals of the hit faces in the camera's frame, towards the camera;
        arbitrary for a miss."""
        normals = self._normals @ X_CB[:3, :3].astype(np.float32).T
        seen: Single = normals[hits.face.ravel()]
        seen[np.einsum("ij,ij->i", seen, hits.unit) > 0.0] *= -1.0
        return seen.reshape(*hits.face.shape, 3)

    @cached_property
    def _rays(self) -> RayCaster:
        return RayCaster(self._vertices, self._faces)

    @cached_property
    def _normals(self) -> Single:
        """(F, 3) unit normals of the faces, zero for a face without area."""
        a, b, c = self._vertices[self._faces].transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        unit = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0.0)
        return np.asarray(unit.astype(np.float32))


def surfaces_of_body(label: int, parts: Sequence[tuple[Array, Indices]]) -> list[RaySurface]:
    """Surfaces of a body's shapes, as few as possible: an object gets one, and so do shapes that
    form a box together, such as the two colours of a board.

    Args:
        label: label of the body.
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
    if label != SURROUNDINGS_LABEL or whole.box is not None:
        return [whole]
    return [RaySurface(label, vertices, faces) for vertices, faces in parts]


def _rotate_vectors(unit: Single, R_BC: Array) -> Single:
    """(N, 3) rotated vectors. A matrix product of this shape would start threads and be slower."""
    import cv2

    turned = cv2.transform(unit[:, None], R_BC.astype(np.float32))
    return np.asarray(turned, np.float32).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class Silhouette:
    """Silhouette of an object as a camera would see it without anything in front of it.

    Attributes:
        left, top: image column and row where `mask` begins; may lie outside the image [pixels].
        mask: (h, w) the silhouette in its bounding box; empty if the object is out of view.
    """

    left: int
    top: int
    mask: NDArray[np.bool_]

    def mask_in_image(self, width: int, height: int) -> NDArray[np.bool_]:
        """(height, width) part of the silhouette within an image of that size."""
        image = np.zeros((height, width), bool)
        rows, columns = self.mask.shape
        x, y = max(self.left, 0), max(self.top, 0)
        right, bottom = min(self.left + columns, width), min(self.top + rows, height)
        if x < right and y < bottom:
            part = self.mask[y - self.top : bottom - self.top, x - self.left : right - self.left]
            image[y:bottom, x:right] = part
        return image


class RayScene:
    """Surfaces placed in the scene frame S, for ray casting.

    Args:
        surfaces: at most one of each label, except `SURROUNDINGS_LABEL`.
        X_SB: (4, 4) pose of each surface in S; identity if None.
    """

    def __init__(self, surfaces: Sequence[RaySurface], X_SB: Sequence[Array] | None = None) -> None:
        poses = [np.eye(4)] * len(surfaces) if X_SB is None else X_SB
        self._placed = list(zip(surfaces, poses, strict=True))
        self._of_label = {one.label: (one, pose) for one, pose in self._placed}
        self._last: tuple[View | None, dict[int, SurfaceHits | None]] = None, {}

    def images(self, view: View, *, normals: bool = False) -> Images:
        """Depth and labels of a view, and its normals if `normals` is set."""
        depth, unit_normals, ray_surfaces = self._render_boxes(view, normals)
        labels = np.full(depth.shape, SURROUNDINGS_LABEL, np.uint16)
        self._last = view, {}
        for surface, X_CB in ray_surfaces:
            hits = surface.cast_rays(view.intrinsics, X_CB)
            self._last[1][surface.label] = hits
            if hits is None:
                continue
            left, top, right, bottom = hits.pixels
            area = np.s_[top:bottom, left:right]
            nearest = hits.depth < depth[area]
            depth[area][nearest] = hits.depth[nearest]
            labels[area][nearest] = surface.label
            if unit_normals is not None:
                unit_normals[area][nearest] = surface.normals(hits, X_CB)[nearest]
        near, far = view.depth_range
        depth[(depth < near) | (depth > far)] = 0.0
        return Images(depth=depth, labels=labels, normals=unit_normals)

    def silhouette(self, number: int, view: View) -> Silhouette:
        """See `SceneRenderer.silhouette`."""
        hits = self._cast_whole_surface(number, view)
        mask = np.zeros((0, 0), bool) if hits is None else hits.face != NO_FACE
        box = box_of_mask(mask)
        if hits is None or box is None:
            return Silhouette(0, 0, np.zeros((0, 0), bool))
        left, top, width, height = box
        cut = mask[top : top + height, left : left + width]
        return Silhouette(hits.pixels[0] + left, hits.pixels[1] + top, cut)

    def _render_boxes(
        self, view: View, normals: bool
    ) -> tuple[Single, Single | None, list[tuple[RaySurface, Array]]]:
        """Depth and normals of the surroundings' boxes, and the surfaces that need ray casting."""
        shape = view.intrinsics.height, view.intrinsics.width
        inverse_depth: Single = np.zeros(shape, np.float32)
        plane_index, directions = np.zeros(shape, np.int16), [np.zeros((1, 3))]
        meshes, X_CS = [], inverse(view.X_SC)
        for surface, X_SB in self._placed:
            X_CB, box, box_inverse_depth = X_CS @ X_SB, surface.box, None
            if box is not None and surface.label == SURROUNDINGS_LABEL:
                box_inverse_depth = box.inverse_depth(view.intrinsics, X_CB)
            if box is None or box_inverse_depth is None:
                meshes.append((surface, X_CB))
                continue
            if normals:
                planes = box.entered_planes(view.intrinsics, X_CB) + sum(map(len, directions))
                np.copyto(plane_index, planes, where=box_inverse_depth > inverse_depth)
                directions.append(BOX_NORMALS @ X_CB[:3, :3].T)
            np.maximum(inverse_depth, box_inverse_depth, out=inverse_depth)
        plane_normals = np.concatenate(directions).astype(np.float32)
        with np.errstate(divide="ignore"):
            depth = np.divide(1.0, inverse_depth, out=inverse_depth)
        return depth, np.take(plane_normals, plane_index, axis=0) if normals else None, meshes

    def _cast_whole_surface(self, number: int, view: View) -> SurfaceHits | None:
        """Hits of rays on an object, in the image and beyond it. Reuses the hits of the last image
        if they are complete."""
        last, found = self._last
        known = found.get(number) if last is view else None
        if known is not None:
            left, top, right, bottom = known.pixels
            width, height = view.intrinsics.width, view.intrinsics.height
            if left > 0 and top > 0 and right < width and bottom < height:
                return known
        surface, X_SB = self._of_label[number]
        return surface.cast_rays(view.intrinsics, inverse(view.X_SC) @ X_SB, beyond=True)
