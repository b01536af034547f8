"""Commands that move objects: to poses, into stable poses, onto a grid, down to the table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.compose.commands.command import MAX_COORDINATE, label_of, require_number
from burg_drake.compose.document import (
    State,
    Surroundings,
    bounds,
    nearest_stable_pose,
    object_bounds,
    require_some,
    yaw_between,
)
from burg_drake.core import Array, InvalidInputError, check_pose, make_pose, rot_z
from burg_drake.scene.document import TOUCH_TOLERANCE


@dataclass(frozen=True, eq=False)
class MoveObjects:
    """Brings objects to other poses.

    Attributes:
        X_SO: (4, 4) poses by instance. Where movement is planar, objects keep their height and
            tilt.
        changes_height: Heights change even while objects are kept upright.
    """

    X_SO: Mapping[str, ArrayLike] = field(default_factory=dict)
    changes_height: bool = False

    @property
    def label(self) -> str:
        return label_of("move", tuple(self.X_SO))

    def apply(self, state: State, surroundings: Surroundings) -> State:
        require_some(self.X_SO, state)
        X_SO = {name: _checked(X, name) for name, X in self.X_SO.items()}
        if surroundings.planar:
            X_SO = {
                name: upright(state.X_SO(name), X, changes_height=self.changes_height)
                for name, X in X_SO.items()
            }
        return state.moved(X_SO).select(X_SO)


@dataclass(frozen=True)
class SetPose:
    """Puts objects into a stable pose.

    Each keeps where its centre of mass is above the board, its yaw, and the height that it stands
    at.

    Attributes:
        names: instances.
        stable_pose: number in the library's entry, the most probable one first.
    """

    names: tuple[str, ...]
    stable_pose: int = 0

    @property
    def label(self) -> str:
        return label_of(f"stable pose {self.stable_pose} of", tuple(self.names))

    def apply(self, state: State, surroundings: Surroundings) -> State:
        names = require_some(self.names, state)
        return state.moved({n: self._pose(state, n) for n in names}).select(names)

    def _pose(self, state: State, name: str) -> Array:
        X_SO = state.X_SO(name)
        p_OcmO = np.array(state.entry(name).mass_properties.center_of_mass)
        p_SOcm = X_SO[:3, :3] @ p_OcmO + X_SO[:3, 3]
        _, yaw = nearest_stable_pose(state, name) or (0, 0.0)
        height = max(float(bounds(state, name)[0, 2]), 0.0)
        if height <= TOUCH_TOLERANCE:
            height = 0.0
        return standing(
            stable_pose_matrix(state, state.instance(name).object, self.stable_pose),
            (float(p_SOcm[0]), float(p_SOcm[1])),
            yaw,
            height,
        )


@dataclass(frozen=True)
class Turn:
    """Turns objects about the vertical through the middle of their bounds.

    Attributes:
        names: instances; several turn as one.
        angle_deg: counter-clockwise, seen from above.
    """

    names: tuple[str, ...]
    angle_deg: float

    @property
    def label(self) -> str:
        return label_of("turn", tuple(self.names))

    def apply(self, state: State, surroundings: Surroundings) -> State:
        names = require_some(self.names, state)
        angle = math.radians(require_number(self.angle_deg, "the angle", -360.0, 360.0, "degrees"))
        corners = np.concatenate([bounds(state, name) for name in names])
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        X_SM = make_pose(p_AB=(middle[0], middle[1], 0.0))
        X_MS = make_pose(p_AB=(-middle[0], -middle[1], 0.0))
        X = X_SM @ make_pose(rot_z(angle)) @ X_MS
        return state.moved({name: X @ state.X_SO(name) for name in names}).select(names)


@dataclass(frozen=True)
class SnapToGrid:
    """Brings the origins of objects to the nearest points of a grid over the board.

    Attributes:
        names: instances.
        spacing: of the grid, which starts in the board's corner [m].
    """

    names: tuple[str, ...]
    spacing: float = 0.01

    @property
    def label(self) -> str:
        return label_of("snap to grid", tuple(self.names))

    def apply(self, state: State, surroundings: Surroundings) -> State:
        names = require_some(self.names, state)
        spacing = require_number(self.spacing, "spacing of the grid", 1e-4, 1.0, "m")
        X_SO = {name: state.X_SO(name) for name in names}
        for X in X_SO.values():
            X[:2, 3] = np.round(X[:2, 3] / spacing) * spacing
        return state.moved(X_SO).select(names)


def standing(
    X_SO: Array, position: tuple[float, float], yaw: float = 0.0, height: float = 0.0
) -> Array:
    """(4, 4) object that stands on the board.

    Args:
        X_SO: (4, 4) stable pose as a library has it, the centre of mass above the origin.
        position: of the centre of mass in the scene [m].
        yaw: by which it is turned [rad].
        height: of what it stands on, above the board [m].
    """
    return make_pose(rot_z(yaw), (*position, height)) @ X_SO


def stable_pose_matrix(state: State, object: str, stable_pose: int) -> Array:
    """(4, 4) stable pose of an object; furniture without any stands as its mesh does.

    Raises:
        InvalidInputError: it has no such stable pose.
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


def upright(X_SO: Array, X_new: Array, *, changes_height: bool) -> Array:
    """(4, 4) `X_new` with the tilt of `X_SO`, and with its height unless heights change."""
    R_SO = X_SO[:3, :3]
    yaw = yaw_between(R_SO, X_new[:3, :3])
    height = (X_new if changes_height else X_SO)[2, 3]
    return make_pose(rot_z(yaw) @ R_SO, (*X_new[:2, 3], height))


def _checked(X_SO: ArrayLike, name: str) -> Array:
    X = np.array(X_SO, dtype=float)
    if X.shape != (4, 4):
        raise InvalidInputError(f"the pose of {name!r} has shape {X.shape}; expected (4, 4)")
    if np.isfinite(X).all():
        for axis, value in zip("xyz", X[:3, 3], strict=True):
            require_number(
                float(value), f"{axis} of {name!r}", -MAX_COORDINATE, MAX_COORDINATE, "m"
            )
    return check_pose(X, f"the pose of {name!r}")
