"""The handles that move and turn the selection, and the pointer that operates them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import viser
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from burg_drake.compose import Drag, SessionView, instance_bounds, missing_objects
from burg_drake.core import (
    Array,
    inverse,
    make_pose,
    quaternion_from_rotation,
    rotation_from_quaternion,
    transform_points,
)
from burg_drake.ui.page_actions import PageActions

MIN_RAY_SLOPE = 0.02
"""Smallest sine of the angle between a ray and a plane; flatter rays are ignored."""


@dataclass(frozen=True, eq=False)
class PageCamera:
    """The camera of a page.

    Attributes:
        X_SC: (4, 4) camera in the scene: z forward, x right, y down.
        fov: vertical angle of view [rad].
        aspect: width over height.
    """

    X_SC: Array
    fov: float
    aspect: float

    @classmethod
    def from_viser(cls, camera: Any) -> PageCamera:
        """The camera from a viser client's `camera`."""
        X_SC = make_pose(rotation_from_quaternion(camera.wxyz), camera.position)
        return cls(X_SC, float(camera.fov), float(camera.aspect))

    def intersect_plane(
        self, p_SQ: ArrayLike, p_SP: ArrayLike, normal_S: ArrayLike
    ) -> Array | None:
        """Intersection of the ray from the camera through Q with a plane.

        Args:
            p_SQ: (3,) a point on the pointer's ray [m].
            p_SP: (3,) a point of the plane [m].
            normal_S: (3,) unit normal of the plane.

        Returns:
            (3,) the point [m]; None if the ray is nearly parallel to the plane or leads away.
        """
        max_distance = 20.0  # Maximum distance of the point from the camera, in metres.
        eye = self.X_SC[:3, 3]
        ray = np.asarray(p_SQ, dtype=float) - eye
        length = float(np.linalg.norm(ray))
        if length == 0.0:
            return None
        ray /= length
        slope = float(ray @ np.asarray(normal_S, dtype=float))
        if abs(slope) < MIN_RAY_SLOPE:
            return None
        distance = float((np.asarray(p_SP) - eye) @ np.asarray(normal_S)) / slope
        return eye + distance * ray if 0.0 < distance <= max_distance else None

    def project(self, p_SQ: ArrayLike) -> Array:
        """(N, 2) projections of points (N, 3): 0 to 1 from left to right and from top to bottom.

        NaN for points behind the camera.
        """
        p_CQ = transform_points(inverse(self.X_SC), np.atleast_2d(np.asarray(p_SQ, dtype=float)))
        depth = np.where(p_CQ[:, 2] > 0.0, p_CQ[:, 2], np.nan)
        half = np.tan(self.fov / 2.0)
        x = p_CQ[:, 0] / depth / (half * self.aspect)
        y = p_CQ[:, 1] / depth / half
        return 0.5 + 0.5 * np.stack([x, y], axis=-1)


def instance_center(view: SessionView, name: str) -> Array:
    """(3,) centre of an instance's bounding box in S [m]; its origin if its object is unknown."""
    X_SO = view.X_SO(name)
    entry = view.library.objects.get(view.instances[name].object)
    if entry is None:
        return X_SO[:3, 3]
    p_OM = (np.array(entry.lower) + np.array(entry.upper)) / 2.0
    return np.asarray(X_SO[:3, :3] @ p_OM + X_SO[:3, 3])


def mean_center(view: SessionView, names: Iterable[str]) -> Array:
    """(3,) mean of the centres of one or more instances in S [m]."""
    return np.asarray(np.mean([instance_center(view, name) for name in names], axis=0))


def rotation_about_point(p_SM: Array, R: Array, offset: Array) -> Array:
    """(4, 4) motion in S: a rotation (3, 3) about a point (3,), then an offset (3,) [m]."""
    return make_pose(R, p_SM + offset - R @ p_SM)


GIZMO_SIZE = 0.11
"""Length of the arrows in metres; other parts scale with it, as in drei's PivotControls."""


@dataclass(frozen=True, eq=False)
class Handle:
    """A part of the gizmo.

    Attributes:
        kind: an arrow moves along an axis, a square across it, and a ring turns about it.
        X_SG: (4, 4) pose of the gizmo.
        axis: 0, 1 or 2.
    """

    kind: Literal["arrow", "square", "ring"]
    X_SG: Array
    axis: int

    def distance(self, camera: PageCamera, p_SQ: Array) -> float | None:
        """Distance along the ray through Q to the handle [m]; None if the ray misses it.

        Args:
            camera: camera of the page.
            p_SQ: (3,) a point on the pointer's ray [m].
        """
        half_width = 0.07 * GIZMO_SIZE  # Metres by which a pointer may miss an arrow or a ring.
        # Metres from the gizmo's origin; closer to it, the pointer hits the object itself.
        arrow_start = 0.2 * GIZMO_SIZE
        ring_radius = 0.65 * GIZMO_SIZE  # Metres.
        # Metres that a square extends along both of its axes.
        square_range = (0.13 * GIZMO_SIZE, 0.355 * GIZMO_SIZE)
        eye = camera.X_SC[:3, 3]
        if self.kind == "arrow":
            along = self._axis_coordinate(camera, p_SQ)
            if along is None:
                return None
            p_SA = self._origin + np.clip(along, arrow_start, GIZMO_SIZE) * self._direction
            ray = (p_SQ - eye) / np.linalg.norm(p_SQ - eye)
            distance = float((p_SA - eye) @ ray)
            near = float(np.linalg.norm(eye + distance * ray - p_SA)) <= half_width
            return distance if near and distance > 0.0 else None
        p_SP = camera.intersect_plane(p_SQ, self._origin, self._direction)
        if p_SP is None:
            return None
        across = np.delete(self.X_SG[:3, :3].T @ (p_SP - self._origin), self.axis)
        if self.kind == "square":
            hit = bool(((across >= square_range[0]) & (across <= square_range[1])).all())
        else:
            far = abs(float(np.linalg.norm(across)) - ring_radius)
            hit = far <= half_width and bool((across >= 0.0).all())
        return float(np.linalg.norm(p_SP - eye)) if hit else None

    def motion(self, camera: PageCamera, p_SQ: Array, p_SQ_now: Array) -> Array | None:
        """(4, 4) motion in S of the dragged objects for a movement of the pointer.

        Args:
            camera: camera of the page.
            p_SQ, p_SQ_now: (3,) points on the pointer's ray at the start and now [m].

        Returns:
            None if the view is along the handle, so that the motion is undefined.
        """
        if self.kind == "arrow":
            then, now = self._axis_coordinate(camera, p_SQ), self._axis_coordinate(camera, p_SQ_now)
            if then is None or now is None:
                return None
            return make_pose(p_AB=(now - then) * self._direction)
        ends = [camera.intersect_plane(p, self._origin, self._direction) for p in (p_SQ, p_SQ_now)]
        if ends[0] is None or ends[1] is None:
            return None
        if self.kind == "square":
            return make_pose(p_AB=ends[1] - ends[0])
        a, b = ends[0] - self._origin, ends[1] - self._origin
        angle = float(np.arctan2(np.cross(a, b) @ self._direction, a @ b))
        R = Rotation.from_rotvec(angle * self._direction).as_matrix()
        return rotation_about_point(self._origin, R, np.zeros(3))

    @property
    def _origin(self) -> Array:
        return np.asarray(self.X_SG[:3, 3])

    @property
    def _direction(self) -> Array:
        return np.asarray(self.X_SG[:3, self.axis])

    def _axis_coordinate(self, camera: PageCamera, p_SQ: Array) -> float | None:
        """Coordinate along the axis closest to the ray through Q [m from the origin]; None if the
        view is along the axis."""
        eye, axis = camera.X_SC[:3, 3], self._direction
        ray = (p_SQ - eye) / np.linalg.norm(p_SQ - eye)
        slope = float(ray @ axis)
        if 1.0 - slope**2 < MIN_RAY_SLOPE:
            return None
        between = self._origin - eye
        return float((slope * (between @ ray) - between @ axis) / (1.0 - slope**2))


def handle_under(handles: Iterable[Handle], camera: PageCamera, p_SQ: Array) -> Handle | None:
    """The handle under the pointer that is closest to the camera; None if there is none.

    Args:
        handles: shown handles.
        camera: camera of the page.
        p_SQ: (3,) a point on the pointer's ray [m].
    """
    found = [(handle.distance(camera, p_SQ), handle) for handle in handles]
    hit = [(distance, handle) for distance, handle in found if distance is not None]
    return min(hit, key=lambda pair: pair[0])[1] if hit else None


@dataclass(eq=False)
class _GizmoPart:
    """The arrows or the rings of the gizmo.

    Attributes:
        name: name of the node.
        node: node of viser; None until it is first shown.
        X_SG: (4, 4) shown pose; None while hidden.
    """

    name: str
    node: viser.TransformControlsHandle | None = None
    X_SG: Array | None = None


class Gizmo:
    """Shows handles at the selected objects.

    Args:
        scene: API of viser.
        actions: actions of the page.
    """

    def __init__(self, scene: viser.SceneApi, actions: PageActions) -> None:
        self._scene, self._actions = scene, actions
        self._arrows, self._rings = _GizmoPart("/gizmo/arrows"), _GizmoPart("/gizmo/rings")
        self._along_object = False
        self._planar = True
        self._drag: Drag | None = None
        self._client_id: int | None = None
        self._dragged_part: _GizmoPart | None = None
        self._X_SGi = np.eye(4)

    def show(self, view: SessionView) -> None:
        """Updates the handles from a view, except for dragged ones, which follow the pointer."""
        self._planar = view.planar
        is_dragging = self._drag is not None and not self._drag.is_over
        missing = missing_objects(view.state)
        names = tuple(name for name in view.selection if name not in missing)
        for part, X_SG in (
            (self._arrows, self._arrows_pose(view, names) if names else None),
            (self._rings, self._rings_pose(view, names) if names else None),
        ):
            if is_dragging and part is self._dragged_part:
                continue
            part.X_SG = X_SG
            if X_SG is None:
                if part.node is not None:
                    part.node.visible = False
                continue
            if part.node is None:
                part.node = self._add_node(part)
            axes = (True, True, True)
            if view.planar:
                axes = (False, False, True) if part is self._arrows else (True, True, False)
            if part.node.active_axes != axes:
                part.node.active_axes = axes
                part.node.disable_sliders = view.planar or part is self._rings
            part.node.position = X_SG[:3, 3]
            part.node.wxyz = quaternion_from_rotation(X_SG[:3, :3])
            part.node.visible = True

    def switch_axes(self) -> None:
        """Switches the arrows between the axes of the board and those of the object."""
        self._along_object = not self._along_object
        self.show(self._actions.session.view)

    def handle_under(self, camera: PageCamera, p_SQ: Array) -> Handle | None:
        """The handle under the pointer; see the function `handle_under`."""
        axes = (2,) if self._planar else (0, 1, 2)
        parts: list[Handle] = []
        if (X_SG := self._arrows.X_SG) is not None:
            parts += [Handle("arrow", X_SG, axis) for axis in axes]
            if not self._planar:
                parts += [Handle("square", X_SG, axis) for axis in axes]
        if (X_SG := self._rings.X_SG) is not None:
            parts += [Handle("ring", X_SG, axis) for axis in axes]
        return handle_under(parts, camera, p_SQ)

    def forget_page(self, client_id: int) -> None:
        """Ends the drag of a page that is gone; the objects stay where they are."""
        self._actions.submit(lambda: self._end(client_id))

    def cancel_drag(self, client_id: int) -> bool:
        """Cancels the drag of a page, if there is one; returns whether there was."""
        if self._client_id != client_id or self._drag is None or self._drag.is_over:
            return False
        self._drag.cancel()
        return True

    def _arrows_pose(self, view: SessionView, names: tuple[str, ...]) -> Array:
        middle = mean_center(view, names)
        if view.planar:
            right = max(float(instance_bounds(view.state, name)[1, 0]) for name in names)
            # beside the selection; else the vertical arrow would hide it from above
            return make_pose(p_AB=(right + 0.02, middle[1], middle[2]))
        R_SO = view.X_SO(names[0])[:3, :3]
        is_single = len(names) == 1
        return make_pose(R_SO if is_single and self._along_object else np.eye(3), middle)

    def _rings_pose(self, view: SessionView, names: tuple[str, ...]) -> Array:
        own = len(names) == 1 and not view.planar
        R_SG = view.X_SO(names[0])[:3, :3] if own else np.eye(3)
        return make_pose(R_SG, mean_center(view, names))

    def _add_node(self, part: _GizmoPart) -> viser.TransformControlsHandle:
        node = self._scene.add_transform_controls(
            part.name,
            scale=GIZMO_SIZE,
            line_width=3.0,
            disable_axes=part is self._rings,
            disable_sliders=part is self._rings,
            disable_rotations=part is self._arrows,
            depth_test=False,
            opacity=0.9,
        )

        @node.on_update
        async def _(event: Any) -> None:
            X_SG = make_pose(
                rotation_from_quaternion(event.target.wxyz), np.array(event.target.position)
            )
            client_id, client = event.client_id, event.client
            if event.phase == "start":
                self._actions.submit(lambda: self._begin(client_id, part, X_SG), client)
            elif event.phase == "update":
                self._actions.submit(
                    lambda: self._move(client_id, X_SG), client, key=f"gizmo {client_id}"
                )
            else:
                self._actions.submit(lambda: self._end(client_id), client)

        return node

    def _begin(self, client_id: int | None, part: _GizmoPart, X_SG: Array) -> None:
        self._client_id, self._dragged_part, self._X_SGi = client_id, part, X_SG
        session = self._actions.session
        self._drag = session.drag(session.view.selection)

    def _move(self, client_id: int | None, X_SG: Array) -> None:
        if client_id != self._client_id or self._drag is None or self._drag.is_over:
            return
        self._drag.transform(X_SG @ inverse(self._X_SGi), changes_height=True)

    def _end(self, client_id: int | None) -> None:
        if client_id != self._client_id:
            return
        drag, self._drag, self._client_id, self._dragged_part = self._drag, None, None, None
        if drag is not None and not drag.is_over:
            drag.end()
        self.show(self._actions.session.view)
