"""Commands that move objects: to poses, onto a grid, into alignment, into contact."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.compose.commands import (
    InstancesCommand,
    command_label,
    require_coordinate,
    require_number,
)
from burg_drake.compose.scene_checker import (
    Surroundings,
    instance_bounds,
    nearest_stable_pose,
    object_bounds,
    scene_of_known_objects,
    yaw_between,
)
from burg_drake.compose.state import State, require_instance_names
from burg_drake.core import Array, InvalidInputError, check_pose, make_pose, rot_z
from burg_drake.scene import TOUCH_TOLERANCE


@dataclass(frozen=True, eq=False)
class MoveObjects:
    """Moves objects to given poses.

    Attributes:
        X_SO: (4, 4) poses by instance. With planar movement, objects keep their height and tilt.
        changes_height: Heights change even while objects are kept upright.
    """

    X_SO: Mapping[str, ArrayLike] = field(default_factory=dict)
    changes_height: bool = False

    @property
    def label(self) -> str:
        return command_label("move", self.X_SO)

    def apply(self, state: State, surroundings: Surroundings) -> State:
        require_instance_names(self.X_SO, state)
        X_SO = {name: _check_object_pose(X, name) for name, X in self.X_SO.items()}
        if surroundings.planar:
            X_SO = {
                name: keep_tilt(state.X_SO(name), X, changes_height=self.changes_height)
                for name, X in X_SO.items()
            }
        return state.with_poses(X_SO).select(X_SO)


@dataclass(frozen=True)
class SetPose(InstancesCommand):
    """Puts objects into a stable pose.

    Each keeps the horizontal position of its centre of mass, its yaw, and its support height.

    Attributes:
        names: instances.
        stable_pose: number in the library's entry, the most probable one first.
    """

    stable_pose: int = 0

    @property
    def label(self) -> str:
        return command_label(f"stable pose {self.stable_pose} of", self.names)

    def apply(self, state: State, surroundings: Surroundings) -> State:
        names = require_instance_names(self.names, state)
        return state.with_poses({n: self._pose(state, n) for n in names}).select(names)

    def _pose(self, state: State, name: str) -> Array:
        X_SO = state.X_SO(name)
        p_OcmO = np.array(state.entry(name).mass_properties.center_of_mass)
        p_SOcm = X_SO[:3, :3] @ p_OcmO + X_SO[:3, 3]
        _, yaw = nearest_stable_pose(state, name) or (0, 0.0)
        height = float(instance_bounds(state, name)[0, 2])
        if height <= TOUCH_TOLERANCE:
            height = 0.0
        return pose_on_board(
            stable_pose_matrix(state, state.instance(name).object, self.stable_pose),
            (float(p_SOcm[0]), float(p_SOcm[1])),
            yaw,
            height,
        )


@dataclass(frozen=True)
class Turn(InstancesCommand):
    """Turns objects about the vertical through the middle of their bounds.

    Attributes:
        names: instances; several turn as one.
        angle_deg: counter-clockwise, seen from above.
    """

    verb = "turn"

    angle_deg: float

    def apply(self, state: State, surroundings: Surroundings) -> State:
        names = require_instance_names(self.names, state)
        angle = math.radians(require_number(self.angle_deg, "the angle", -360.0, 360.0, "degrees"))
        corners = np.concatenate([instance_bounds(state, name) for name in names])
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        X_SM = make_pose(p_AB=(middle[0], middle[1], 0.0))
        X_MS = make_pose(p_AB=(-middle[0], -middle[1], 0.0))
        X = X_SM @ make_pose(rot_z(angle)) @ X_MS
        return state.with_poses({name: X @ state.X_SO(name) for name in names}).select(names)


@dataclass(frozen=True)
class SnapToGrid(InstancesCommand):
    """Moves the origins of objects to the nearest points of a grid over the board.

    Attributes:
        names: instances.
        spacing: spacing of the grid, which starts at the board's corner [m].
    """

    verb = "snap to grid"

    spacing: float = 0.01

    def apply(self, state: State, surroundings: Surroundings) -> State:
        names = require_instance_names(self.names, state)
        spacing = require_number(self.spacing, "spacing of the grid", 1e-4, 1.0, "m")
        X_SO = {name: state.X_SO(name) for name in names}
        for X in X_SO.values():
            X[:2, 3] = np.round(X[:2, 3] / spacing) * spacing
        return state.with_poses(X_SO).select(names)


def pose_on_board(
    X_SO: Array, position: tuple[float, float], yaw: float = 0.0, height: float = 0.0
) -> Array:
    """(4, 4) pose of an object on the board.

    Args:
        X_SO: (4, 4) stable pose as in a library, with the centre of mass above the origin.
        position: position of the centre of mass in the scene [m].
        yaw: rotation about the vertical [rad].
        height: height of the support above the board [m].
    """
    return make_pose(rot_z(yaw), (*position, height)) @ X_SO


def stable_pose_matrix(state: State, object: str, stable_pose: int) -> Array:
    """(4, 4) stable pose of an object; furniture without stable poses stands as its mesh is.

    Raises:
        InvalidInputError: the object has no such stable pose.
    """
    entry = state.library.entry(object)
    if not entry.stable_poses and stable_pose == 0:
        lowest = float(object_bounds(state.library, object, np.eye(4))[0, 2])
        x, y, _ = entry.mass_properties.center_of_mass
        return make_pose(p_AB=(-x, -y, -lowest))
    try:
        return entry.X_SO(stable_pose)
    except InvalidInputError as error:
        raise InvalidInputError(f"{object!r}: {error}") from error


def keep_tilt(X_SO: Array, X_new: Array, *, changes_height: bool) -> Array:
    """(4, 4) `X_new` with the tilt of `X_SO`, and with its height unless heights change."""
    R_SO = X_SO[:3, :3]
    yaw = yaw_between(R_SO, X_new[:3, :3])
    height = (X_new if changes_height else X_SO)[2, 3]
    return make_pose(rot_z(yaw) @ R_SO, (*X_new[:2, 3], height))


def _check_object_pose(X_SO: ArrayLike, name: str) -> Array:
    X = np.array(X_SO, dtype=float)
    if X.shape != (4, 4):
        raise InvalidInputError(f"the pose of {name!r} has shape {X.shape}; expected (4, 4)")
    if np.isfinite(X).all():
        for axis, value in zip("xyz", X[:3, 3], strict=True):
            require_coordinate(float(value), f"{axis} of {name!r}")
    return check_pose(X, f"the pose of {name!r}")


Edge = Literal["left", "right", "top", "bottom", "center_x", "center_y"]
Axis = Literal["x", "y"]


@dataclass(frozen=True)
class Align(InstancesCommand):
    """Aligns edges or middles of objects.

    Attributes:
        names: instances, two or more.
        edge: edge of the footprints; all are aligned with that of the outermost object.
    """

    edge: Edge

    @property
    def label(self) -> str:
        return command_label(f"align {self.edge.replace('_', ' ')} of", self.names)

    def apply(self, state: State, surroundings: Surroundings) -> State:
        # Axis and part of the bounds by name, with y up in the view from above.
        edges = {
            "left": (0, "lower"),
            "right": (0, "upper"),
            "center_x": (0, "middle"),
            "bottom": (1, "lower"),
            "top": (1, "upper"),
            "center_y": (1, "middle"),
        }
        if self.edge not in edges:
            raise InvalidInputError(f"cannot align {self.edge!r}; give one of {', '.join(edges)}")
        names = require_instance_names(self.names, state, 2)
        axis, what = edges[self.edge]
        spans = np.array([instance_bounds(state, name)[:, axis] for name in names])
        if what == "lower":
            shifts = spans[:, 0].min() - spans[:, 0]
        elif what == "upper":
            shifts = spans[:, 1].max() - spans[:, 1]
        else:
            shifts = (spans.min() + spans.max()) / 2 - spans.mean(axis=1)
        return _shift_along_axis(state, names, axis, shifts)


@dataclass(frozen=True)
class Distribute(InstancesCommand):
    """Makes the gaps between objects equal; the two outermost stay.

    Attributes:
        names: instances, three or more.
        axis: along which the gaps are.
    """

    axis: Axis

    @property
    def label(self) -> str:
        return command_label(f"distribute along {self.axis}", self.names)

    def apply(self, state: State, surroundings: Surroundings) -> State:
        if self.axis not in ("x", "y"):
            raise InvalidInputError(f"cannot distribute along {self.axis!r}; give x or y")
        names = require_instance_names(self.names, state, 3)
        axis = "xy".index(self.axis)
        spans = np.array([instance_bounds(state, name)[:, axis] for name in names])
        order = np.argsort(spans.mean(axis=1), kind="stable")
        sizes = (spans[:, 1] - spans[:, 0])[order]
        first, last = spans[order[0], 0], spans[order[-1], 1]
        gap = (last - first - sizes.sum()) / (len(names) - 1)
        starts = first + np.concatenate([[0.0], np.cumsum(sizes[:-1] + gap)])
        shifts = np.zeros(len(names))
        shifts[order] = starts - spans[order, 0]
        shifts[order[[0, -1]]] = 0.0
        return _shift_along_axis(state, names, axis, shifts)


def _shift_along_axis(state: State, names: tuple[str, ...], axis: int, shifts: Array) -> State:
    X_SO = {}
    for name, shift in zip(names, shifts, strict=True):
        if abs(shift) > 1e-9:
            X_SO[name] = state.X_SO(name)
            X_SO[name][axis, 3] += shift
    return state.with_poses(X_SO).select(names)


Direction = Literal["x", "-x", "y", "-y"]


@dataclass(frozen=True)
class SnapToContact(InstancesCommand):
    """Moves objects along the board until they touch something or reach its edge.

    Attributes:
        names: instances; several move together.
        direction: along an axis of the board.
    """

    verb = "snap to contact"

    direction: Direction

    def apply(self, state: State, surroundings: Surroundings) -> State:
        # Axis of the board and sign.
        directions = {"x": (0, 1), "-x": (0, -1), "y": (1, 1), "-y": (1, -1)}
        names = require_instance_names(self.names, state)
        if self.direction not in directions:
            raise InvalidInputError(
                f"direction is {self.direction!r}; give one of {', '.join(directions)}"
            )
        axis, sign = directions[self.direction]
        spans = np.array([instance_bounds(state, name)[:, axis] for name in names])
        edge = state.document.board.size[axis] - spans.max() if sign > 0 else spans.min()
        return _move_to_contact(
            state, names, sign * np.eye(3)[axis], max(float(edge), 0.0), surroundings
        )


@dataclass(frozen=True)
class PutDown(InstancesCommand):
    """Lowers objects until they stand on the board or on the object below.

    Objects that reach below the board are lifted onto it.

    Attributes:
        names: instances; each is lowered on its own, the lowest first.
    """

    verb = "put down"

    def apply(self, state: State, surroundings: Surroundings) -> State:
        names = require_instance_names(self.names, state)
        heights = {name: float(instance_bounds(state, name)[0, 2]) for name in names}
        for name in sorted(names, key=heights.__getitem__):
            if heights[name] < 0.0:
                state = state.with_poses({name: _shifted_pose(state, name, (0, 0, -heights[name]))})
            else:
                down = np.array((0.0, 0.0, -1.0))
                state = _move_to_contact(state, (name,), down, heights[name], surroundings)
        return state.select(names)


def _move_to_contact(
    state: State, names: tuple[str, ...], direction: Array, limit: float, surroundings: Surroundings
) -> State:
    """Moves instances together along a direction (3,) until contact, at most `limit` [m]."""
    scene = scene_of_known_objects(state, surroundings.path)
    distance = surroundings.checker.check(state).travel(scene, names, direction, limit)
    if distance <= 0.0:
        return state.select(names)
    X_SO = {name: _shifted_pose(state, name, distance * direction) for name in names}
    return state.with_poses(X_SO).select(names)


def _shifted_pose(state: State, name: str, offset: Array | tuple[float, float, float]) -> Array:
    return np.asarray(make_pose(p_AB=offset) @ state.X_SO(name))
