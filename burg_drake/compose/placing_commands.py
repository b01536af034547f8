"""Commands that add, delete, duplicate, rename or fix objects, or place them at random."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from burg_drake.compose.commands import (
    InstancesCommand,
    command_label,
    require_coordinate,
    require_number,
)
from burg_drake.compose.moving_commands import pose_on_board, stable_pose_matrix
from burg_drake.compose.scene_checker import (
    Surroundings,
    find_free_offset,
    find_free_place,
    instance_bounds,
    instance_shadow,
    library_shapes,
    missing_objects,
    object_bounds,
    object_shadow,
    object_vertices,
    scene_of_known_objects,
)
from burg_drake.compose.state import State, instance_name, rename_instance, require_instance_names
from burg_drake.core import (
    Array,
    InvalidInputError,
    Pose,
    list_names,
    make_pose,
    transform_points,
    unused_name,
)
from burg_drake.scene import (
    Instance,
    LayoutName,
    ObjectRequest,
    PoseChoice,
    arrange,
    choose_objects,
    convex_polygon,
    polygon_area,
)
from burg_drake.station import obstacle_corners


@dataclass(frozen=True)
class AddObject:
    """Puts an object of the library on the board.

    Attributes:
        object: its name in the library.
        stable_pose: number of the stable pose; if None, the orientation of its mesh if that is
            stable, else the most probable stable pose, or the next one for which there is room.
        position: x and y of its centre of mass [m]; a free place near the middle if None. The
            command fails if there is none.
        yaw_deg: rotation about the vertical; None for 0, or 45, 90 or 135 if there is no room
            at 0.
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
        x = require_coordinate(position[0], f"x of the new {self.object!r}")
        y = require_coordinate(position[1], f"y of the new {self.object!r}")
        name = unused_name(self.object, surroundings.taken_names(state))
        X_new = Pose.readable(pose_on_board(X_SO, (x, y), yaw))
        instance = rename_instance(Instance(object=self.object, X_SO=X_new), name)
        return state.with_instances([instance], fixed=_names_without_mass(state, [instance]))

    def _free_place(
        self, state: State, surroundings: Surroundings, yaw_deg: float
    ) -> tuple[Array, float, tuple[float, float]]:
        """Stable pose (4, 4), yaw [degrees] and position [m] of a free place."""
        library = state.library
        entry = library.entry(self.object)
        poses = [entry.proposed_pose, *range(len(entry.stable_poses))]
        for k in dict.fromkeys(poses) if self.stable_pose is None else (self.stable_pose,):
            X_SO = stable_pose_matrix(state, self.object, k)
            lower, upper = object_bounds(library, self.object, X_SO)[:, 2]
            obstacles = _station_obstacles(surroundings, lower, upper)
            for turn in (0.0, 90.0, 45.0, 135.0) if self.yaw_deg is None else (0.0,):
                X_turned = pose_on_board(X_SO, (0.0, 0.0), np.deg2rad(yaw_deg + turn))
                polygon = object_shadow(library, self.object, X_turned)
                spot = find_free_place(polygon, state, obstacles)
                if spot is not None:
                    return X_SO, yaw_deg + turn, spot
        raise InvalidInputError(
            f"there is no free place for {self.object!r} on the board; make room, or choose a"
            " larger board"
        )


@dataclass(frozen=True)
class Delete(InstancesCommand):
    """Removes instances from the scene."""

    verb = "delete"

    def apply(self, state: State, surroundings: Surroundings) -> State:
        names = require_instance_names(self.names, state)
        return state.replace_instances(lambda i: None if instance_name(i) in names else i)


@dataclass(frozen=True)
class Duplicate(InstancesCommand):
    """Puts copies of instances beside them.

    Attributes:
        names: names of the instances to copy; several keep their relative poses.
        offset: offset from each instance to its copy along x and y [m]; if None, the shortest
            offset with all copies on the board and free, else to the right of all objects.
    """

    verb = "duplicate"

    offset: tuple[float, float] | None = None

    def apply(self, state: State, surroundings: Surroundings) -> State:
        names = require_instance_names(self.names, state)
        offset = _copy_offset(state, surroundings, names) if self.offset is None else self.offset
        x = require_coordinate(offset[0], "offset along x")
        y = require_coordinate(offset[1], "offset along y")
        X = make_pose(p_AB=(x, y, 0.0))
        taken, copies = set(surroundings.taken_names(state)), []
        fixed = set()
        for name in names:
            copy_name = unused_name(name, taken)
            taken.add(copy_name)
            copy = replace(state.instance(name), X_SO=Pose.readable(X @ state.X_SO(name)))
            copies.append(rename_instance(copy, copy_name))
            if state.instance(name) in state.document.background:
                fixed.add(copy_name)
        return state.with_instances(copies, fixed=fixed)


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
        renamed = state.replace_instances(
            lambda i: rename_instance(i, self.new) if instance_name(i) == self.name else i
        )
        return renamed.select([self.new])


@dataclass(frozen=True)
class SetFixed(InstancesCommand):
    """Makes free instances part of the background, or background instances free.

    Attributes:
        names: instances.
        fixed: whether they keep their poses when the scene is simulated.
    """

    fixed: bool = True

    @property
    def label(self) -> str:
        return command_label("fix" if self.fixed else "free", self.names)

    def apply(self, state: State, surroundings: Surroundings) -> State:
        names = require_instance_names(self.names, state)
        if not self.fixed:
            heavy = _names_without_mass(state, [state.instance(name) for name in names])
            if heavy:
                raise InvalidInputError(
                    f"{sorted(heavy)[0]!r} has no mass, so it must stay background; build its"
                    " object with a mass to make it free"
                )
        document = state.document
        others = document.instances if self.fixed else document.background
        moving = [i for i in others if instance_name(i) in names]
        rest = state.replace_instances(lambda i: None if i in moving else i)
        fixed = map(instance_name, moving) if self.fixed else ()
        return rest.with_instances(moving, fixed=tuple(fixed)).select(names)


@dataclass(frozen=True)
class Clear:
    """Removes all objects from the board."""

    label = "clear scene"

    def apply(self, state: State, surroundings: Surroundings) -> State:
        document = replace(state.document, instances=(), background=())
        return replace(state, document=document, selection=())


def _names_without_mass(state: State, instances: list[Instance]) -> set[str]:
    return {instance_name(i) for i in instances if state.library.entry(i.object).is_fixed}


def _station_obstacles(surroundings: Surroundings, lower: float, upper: float) -> list[Array]:
    """(N, 2) footprints of the station's boxes between two heights [m], on the board [m]."""
    return [
        convex_polygon(p_SV[:, :2])
        for p_SV in obstacle_corners(surroundings.station)
        if p_SV[:, 2].min() < upper and p_SV[:, 2].max() > max(lower, 0.0)
    ]


def _copy_offset(
    state: State, surroundings: Surroundings, names: tuple[str, ...]
) -> tuple[float, float]:
    """Offset of copies: the shortest one to a free place on the board, else to the right of all
    objects."""
    heights = [instance_bounds(state, name)[:, 2] for name in names]
    obstacles = _station_obstacles(surroundings, float(np.min(heights)), float(np.max(heights)))
    polygons = [instance_shadow(state, name) for name in names]
    offset = find_free_offset(polygons, state, obstacles)
    if offset is None:
        lost = missing_objects(state)
        others = [instance_shadow(state, name) for name in state.instances if name not in lost]
        right = max(float(polygon[:, 0].max()) for polygon in (*others, *obstacles))
        left = min(float(polygon[:, 0].min()) for polygon in polygons)
        return right + 0.01 - left, 0.0  # with a gap of 1 cm
    return float(offset[0]), float(offset[1])


MAX_RANDOM_OBJECTS = 60
"""Maximum number of objects in a random configuration."""


@dataclass(frozen=True)
class RandomConfiguration:
    """Gives free objects random positions and stable poses; the background stays.

    Attributes:
        seed: the same seed gives the same configuration.
        count: number of objects of the library that replace the free objects; if None, the free
            objects of the scene are placed anew.
        layout: arrangement of the objects; see `scene.scene_document.LayoutName`.
        poses: how stable poses are drawn.
        repeat: whether an object of the library may be used several times.
    """

    seed: int = 0
    count: int | None = None
    layout: LayoutName = "random"
    poses: PoseChoice = "probability"
    repeat: bool = False

    label = "random configuration"

    def apply(self, state: State, surroundings: Surroundings) -> State:
        rng = np.random.default_rng(int(require_number(self.seed, "seed", 0, 2**63, "")))
        wanted = self._object_requests(state, surroundings, rng)
        shapes, board = library_shapes(surroundings.checker, state), state.document.board
        covered = sum(min(map(polygon_area, shapes[one.object].shadows)) for one in wanted)
        if self.layout != "heap" and covered > board.size[0] * board.size[1]:
            raise InvalidInputError(
                f"{len(wanted)} objects need more area than the board has; choose fewer, or a"
                " larger board"
            )
        found = arrange(
            wanted,
            shapes,
            board,
            rng,
            layout=self.layout,
            poses=self.poses,
            obstacles=_obstacle_bodies(state, surroundings),
            needs_all=True,
        )
        if found.missing:
            raise InvalidInputError(
                f"the board has no room for {len(found.missing)} of {len(wanted)} objects"
                f" ({list_names(found.missing)}); choose fewer, another seed, or a larger board"
            )
        document = replace(state.document, instances=found.instances)
        return replace(state, document=document, selection=())

    def _object_requests(
        self, state: State, surroundings: Surroundings, rng: np.random.Generator
    ) -> tuple[ObjectRequest, ...]:
        scene = scene_of_known_objects(state, surroundings.path)
        if self.count is None:
            if not scene.instances:
                raise InvalidInputError(
                    "there are no objects to arrange; add some, or give a count"
                )
            return tuple(ObjectRequest(name=n, object=i.object) for n, i in scene.instances.items())
        count = int(require_number(self.count, "number of objects", 1, MAX_RANDOM_OBJECTS, ""))
        taken = set(surroundings.taken_names(state)) - set(scene.instances)
        return choose_objects(state.library, count, rng, repeat=self.repeat, taken=sorted(taken))


def _obstacle_bodies(state: State, surroundings: Surroundings) -> list[Array]:
    """Points (N, 3) of the convex obstacles [m]: hulls of the background, and boxes of the station
    that reach above the board."""
    scene = scene_of_known_objects(state, surroundings.path)
    bodies = [
        transform_points(scene.X_SO(name), object_vertices(state.library, instance.object))
        for name, instance in scene.background.items()
    ]
    bodies += obstacle_corners(surroundings.station)
    return [p_SV for p_SV in bodies if p_SV[:, 2].max() > 0.0]
