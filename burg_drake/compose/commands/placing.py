"""Commands that change what is in a scene: add, delete, duplicate, rename, fix, clear."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from burg_drake.compose.commands.command import MAX_COORDINATE, label_of, require_number
from burg_drake.compose.commands.moving import stable_pose_matrix, standing
from burg_drake.compose.document import (
    State,
    Surroundings,
    bounds,
    free_offset,
    free_spot,
    missing_objects,
    name_of,
    named,
    object_bounds,
    object_shadow,
    require_some,
    shadow,
    unused_name,
)
from burg_drake.core import Array, InvalidInputError, make_pose
from burg_drake.core.documents import Pose
from burg_drake.scene.arrangement import convex_polygon
from burg_drake.scene.document import Instance
from burg_drake.station.document import boxes_in_scene

COPY_GAP = 0.01
"""Gap between the board's objects and copies for which the board has no room [m]."""


@dataclass(frozen=True)
class AddObject:
    """Puts an object of the library on the board.

    Attributes:
        object: its name in the library.
        stable_pose: that it stands in; if None, as its mesh stands where that is stable, else the
            most probable one, or the next in which there is room.
        position: x and y of its centre of mass [m]; a free place near the middle if None. It is
            refused if there is none.
        yaw_deg: by which it is turned; not at all if None, unless there is room only if it is.
    """

    object: str
    stable_pose: int | None = None
    position: tuple[float, float] | None = None
    yaw_deg: float | None = None

    @property
    def label(self) -> str:
        return f"add {self.object}"

    def apply(self, state: State, surroundings: Surroundings) -> State:
        proposed = state.library.entry(self.object).proposed_pose
        pose = proposed if self.stable_pose is None else self.stable_pose
        X_SO = stable_pose_matrix(state, self.object, pose)
        yaw_deg = require_number(self.yaw_deg or 0.0, "yaw", -360.0, 360.0, "degrees")
        position = self.position
        if position is None:
            X_SO, yaw_deg, position = self._free_place(state, surroundings, yaw_deg)
        yaw = np.deg2rad(yaw_deg)
        x, y = (
            require_number(
                value, f"{axis} of the new {self.object!r}", -MAX_COORDINATE, MAX_COORDINATE, "m"
            )
            for axis, value in zip("xy", position, strict=True)
        )
        name = unused_name(self.object, surroundings.taken_names(state))
        instance = Instance(
            name="" if name == self.object else name,
            object=self.object,
            X_SO=Pose.readable(standing(X_SO, (x, y), yaw)),
        )
        return state.added([instance], fixed=_without_mass(state, [instance]))

    def _free_place(
        self, state: State, surroundings: Surroundings, yaw_deg: float
    ) -> tuple[Array, float, tuple[float, float]]:
        """Stable pose (4, 4), yaw [degrees] and position [m] where there is room."""
        library = state.library
        entry = library.entry(self.object)
        poses = [entry.proposed_pose, *range(len(entry.stable_poses))]
        for k in dict.fromkeys(poses) if self.stable_pose is None else (self.stable_pose,):
            X_SO = stable_pose_matrix(state, self.object, k)
            lower, upper = object_bounds(library, self.object, X_SO)[:, 2]
            obstacles = _obstacles(surroundings, lower, upper)
            for turn in (0.0, 90.0, 45.0, 135.0) if self.yaw_deg is None else (0.0,):
                X_turned = standing(X_SO, (0.0, 0.0), np.deg2rad(yaw_deg + turn))
                polygon = object_shadow(library, self.object, X_turned)
                spot = free_spot(polygon, state, obstacles)
                if spot is not None:
                    return X_SO, yaw_deg + turn, spot
        raise InvalidInputError(
            f"there is no free place for {self.object!r} on the board; make room, or choose a"
            " larger board"
        )


@dataclass(frozen=True)
class Delete:
    """Takes instances out of the scene."""

    names: tuple[str, ...]

    @property
    def label(self) -> str:
        return label_of("delete", tuple(self.names))

    def apply(self, state: State, surroundings: Surroundings) -> State:
        names = require_some(self.names, state)
        return state.changed(lambda i: None if name_of(i) in names else i)


@dataclass(frozen=True)
class Duplicate:
    """Puts copies beside instances.

    Attributes:
        names: of what is copied; several keep their places to one another.
        offset: from each to its copy along x and y [m]; to the nearest place where all of them are
            on the board and free if None, or to the right of all that is there.
    """

    names: tuple[str, ...]
    offset: tuple[float, float] | None = None

    @property
    def label(self) -> str:
        return label_of("duplicate", tuple(self.names))

    def apply(self, state: State, surroundings: Surroundings) -> State:
        names = require_some(self.names, state)
        offset = _beside(state, surroundings, names) if self.offset is None else self.offset
        x, y = (
            require_number(value, f"offset along {axis}", -MAX_COORDINATE, MAX_COORDINATE, "m")
            for axis, value in zip("xy", offset, strict=True)
        )
        X = make_pose(p_AB=(x, y, 0.0))
        taken, copies = set(surroundings.taken_names(state)), []
        fixed = set()
        for name in names:
            copy_name = unused_name(name, taken)
            taken.add(copy_name)
            copy = replace(state.instance(name), X_SO=Pose.readable(X @ state.X_SO(name)))
            copies.append(named(copy, copy_name))
            if state.instance(name) in state.document.background:
                fixed.add(copy_name)
        return state.added(copies, fixed=fixed)


@dataclass(frozen=True)
class Rename:
    """Gives an instance another name."""

    name: str
    new: str

    @property
    def label(self) -> str:
        return f"rename {self.name}"

    def apply(self, state: State, surroundings: Surroundings) -> State:
        state.instance(self.name)
        if self.new == self.name:
            return state.select([self.name])
        surroundings.require_unused(self.new, state)
        renamed = state.changed(lambda i: named(i, self.new) if name_of(i) == self.name else i)
        return renamed.select([self.new])


@dataclass(frozen=True)
class SetFixed:
    """Makes free instances part of the background, or the other way round.

    Attributes:
        names: instances.
        fixed: whether they shall stay where they are when the scene is simulated.
    """

    names: tuple[str, ...]
    fixed: bool = True

    @property
    def label(self) -> str:
        return label_of("fix" if self.fixed else "free", tuple(self.names))

    def apply(self, state: State, surroundings: Surroundings) -> State:
        names = require_some(self.names, state)
        if not self.fixed:
            heavy = _without_mass(state, [state.instance(name) for name in names])
            if heavy:
                raise InvalidInputError(
                    f"{sorted(heavy)[0]!r} has no mass, so it must stay background; build its"
                    " object with a mass to make it free"
                )
        document = state.document
        others = document.instances if self.fixed else document.background
        moving = [i for i in others if name_of(i) in names]
        rest = state.changed(lambda i: None if i in moving else i)
        fixed = map(name_of, moving) if self.fixed else ()
        return rest.added(moving, fixed=tuple(fixed)).select(names)


@dataclass(frozen=True)
class Clear:
    """Takes everything off the board."""

    label = "clear scene"

    def apply(self, state: State, surroundings: Surroundings) -> State:
        document = replace(state.document, instances=(), background=())
        return replace(state, document=document, selection=())


def _without_mass(state: State, instances: list[Instance]) -> set[str]:
    return {name_of(i) for i in instances if state.library.entry(i.object).is_fixed}


def _obstacles(surroundings: Surroundings, lower: float, upper: float) -> list[Array]:
    """(N, 2) what the station's boxes that reach between two heights [m] cover of the board [m]."""
    return [
        convex_polygon(p_SV[:, :2])
        for p_SV in boxes_in_scene(surroundings.station)
        if p_SV[:, 2].min() < upper and p_SV[:, 2].max() > max(lower, 0.0)
    ]


def _beside(
    state: State, surroundings: Surroundings, names: tuple[str, ...]
) -> tuple[float, float]:
    """Offset of copies: the shortest to where they are free on the board, or to the right of all
    that is there."""
    heights = [bounds(state, name)[:, 2] for name in names]
    obstacles = _obstacles(surroundings, float(np.min(heights)), float(np.max(heights)))
    polygons = [shadow(state, name) for name in names]
    offset = free_offset(polygons, state, obstacles)
    if offset is None:
        lost = missing_objects(state)
        others = [shadow(state, name) for name in state.instances if name not in lost]
        right = max(float(polygon[:, 0].max()) for polygon in (*others, *obstacles))
        return right + COPY_GAP - min(float(polygon[:, 0].min()) for polygon in polygons), 0.0
    return float(offset[0]), float(offset[1])
