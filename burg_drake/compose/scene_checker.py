"""Geometry and checks of the objects on the board: bounds, issues, free places."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from burg_drake.compose.state import State
from burg_drake.core import Array, FieldError, require_name, rot_z, rotation_angle, transform_points
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import (
    TOUCH_TOLERANCE,
    ObjectShapes,
    Scene,
    SceneDocument,
    SceneIssue,
    convex_polygon,
    distances_from_polygon,
    no_fit_polygon,
    read_vertices,
    simplify_polygon,
)
from burg_drake.station import MODEL_NAMES, Station, StationLike, as_station

if TYPE_CHECKING:
    from burg_drake.station import SceneCheck


def object_vertices(library: ObjectLibrary, name: str) -> Array:
    """(N, 3) vertices of an object's convex hull in its own frame [m].

    Raises:
        UnknownNameError: there is no such object, or its mesh is missing.
        MeshError: its mesh is damaged.
    """
    entry = library.entry(name)
    path = library.path(entry.surface or entry.mesh)
    try:
        return _hull_vertices(path, entry.build)
    except (OSError, ValueError) as error:
        raise library.damaged(path) from error


@lru_cache(maxsize=1000)
def _hull_vertices(path: Path, build: str) -> Array:
    """The hull vertices of a mesh file; `build` is the hash of the mesh's source."""
    from scipy.spatial import ConvexHull, QhullError

    p_OV = read_vertices(path)
    try:
        return np.asarray(p_OV[ConvexHull(p_OV).vertices])
    except (QhullError, ValueError):  # flat
        return p_OV


def instance_bounds(state: State, name: str) -> Array:
    """(2, 3) lower and upper corner of an instance's bounding box in the scene frame [m]."""
    return object_bounds(state.library, state.instance(name).object, state.X_SO(name))


def object_bounds(library: ObjectLibrary, object: str, X_SO: Array) -> Array:
    """(2, 3) lower and upper corner of an object's bounding box at a pose X_SO [m]."""
    p_SV = transform_points(X_SO, object_vertices(library, object))
    return np.array([p_SV.min(axis=0), p_SV.max(axis=0)])


def instance_shadow(state: State, name: str) -> Array:
    """(N, 2) convex footprint of an instance on the board [m]; see `object_shadow`."""
    return object_shadow(state.library, state.instance(name).object, state.X_SO(name))


def object_shadow(library: ObjectLibrary, object: str, X_SO: Array) -> Array:
    """(N, 2) convex footprint of an object on the board [m], at most 0.2 mm too large."""
    p_SV = transform_points(X_SO, object_vertices(library, object))
    return simplify_polygon(convex_polygon(p_SV[:, :2]), 2e-4)


def yaw_between(R_SA: Array, R_SB: Array) -> float:
    """The rotation about z that brings A closest to B [rad].

    It maximises trace(R_SB^T Rz R_SA); (3, 3) rotation matrices.
    """
    R = R_SB @ R_SA.T
    return float(np.arctan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1]))


def nearest_stable_pose(state: State, name: str) -> tuple[int, float] | None:
    """Number of the stable pose closest to an instance's orientation, and the yaw [rad].

    None for an object without stable poses.
    """
    R_SO = state.X_SO(name)[:3, :3]
    found: list[tuple[float, int, float]] = []
    for k, stable in enumerate(state.entry(name).stable_poses):
        R_k = stable.X_SO.matrix()[:3, :3]
        yaw = yaw_between(R_k, R_SO)
        tilt = float(rotation_angle((rot_z(yaw) @ R_k).T @ R_SO))
        found.append((round(tilt, 6), k, yaw))
    if not found:
        return None
    _, k, yaw = min(found)
    return k, yaw


class SceneChecker:
    """Checks states on one station; to be used by one thread at a time.

    Args:
        station: station of the scenes.
    """

    def __init__(self, station: StationLike) -> None:
        self._station = as_station(station)
        self._check: SceneCheck | None = None
        self._library: ObjectLibrary | None = None
        self._shapes: ObjectShapes | None = None
        self._state: State | None = None
        self._issues: tuple[SceneIssue, ...] = ()

    def issues(self, state: State, path: Path) -> tuple[SceneIssue, ...]:
        """Issues of the scene without the instances whose object is missing.

        Args:
            state: scene and library.
            path: path of the scene's file, for messages.

        Raises:
            BurgError: the scene cannot be checked, for example as an object's file is missing.
        """
        known = self._state
        if known and known.document == state.document and known.library is state.library:
            return self._issues
        issues = self.check(state).issues(scene_of_known_objects(state, path))
        self._state, self._issues = state, issues
        return issues

    def gaps(self, state: State, path: Path) -> dict[str, float]:
        """Distance straight down to contact of each selected instance without support [m].

        Args:
            state: scene, library and selection.
            path: path of the scene's file, for messages.

        Raises:
            BurgError: see `issues`.
        """
        found, missing = {}, missing_objects(state)
        for name in state.selection:
            if name in missing:
                continue
            height = float(instance_bounds(state, name)[0, 2])
            if height <= TOUCH_TOLERANCE:
                continue
            scene = scene_of_known_objects(state, path)
            gap = self.check(state).travel(scene, (name,), (0.0, 0.0, -1.0), height)
            if gap > TOUCH_TOLERANCE:
                found[name] = gap
        return found

    def check(self, state: State) -> SceneCheck:
        """The collision check for the objects of a state's library."""
        from burg_drake.station import SceneCheck

        if self._check is None or self._library is not state.library:
            self._check, self._library = SceneCheck(self._station, state.library), state.library
        return self._check


def library_shapes(checker: SceneChecker, state: State) -> ObjectShapes:
    """The shapes of a state's library, from the checker's cache."""
    if checker._shapes is None or checker._shapes.library is not state.library:
        checker._shapes = ObjectShapes(state.library)
    return checker._shapes


def missing_objects(state: State) -> tuple[str, ...]:
    """Instances whose object is no longer in the library."""
    return tuple(n for n, i in state.instances.items() if i.object not in state.library.objects)


def scene_of_known_objects(state: State, path: Path) -> Scene:
    """The scene without the instances whose object is missing."""
    names = missing_objects(state)
    if not names:
        return state.scene(path)
    missing = [state.instance(name) for name in names]
    document = replace(
        state.document,
        instances=tuple(i for i in state.document.instances if i not in missing),
        background=tuple(i for i in state.document.background if i not in missing),
    )
    return Scene(document, state.library, path)


def restore_missing_objects(document: SceneDocument, state: State) -> SceneDocument:
    """Adds the left out instances to a document derived from `scene_of_known_objects`."""
    missing = [state.instance(name) for name in missing_objects(state)]
    return replace(
        document,
        instances=(*document.instances, *(i for i in state.document.instances if i in missing)),
        background=(*document.background, *(i for i in state.document.background if i in missing)),
    )


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The context in which a command is applied.

    Attributes:
        station: station of the scene.
        planar: whether moved objects keep their tilt, and their height unless they are raised.
        path: path of the scene's file, for messages.
        checker: finds contacts and free places.
    """

    station: Station
    planar: bool
    path: Path
    checker: SceneChecker

    def taken_names(self, state: State) -> Collection[str]:
        """Names that a new instance may not have."""
        return {*state.instances, *MODEL_NAMES, *self.station.document.background}

    def require_unused(self, name: str, state: State) -> None:
        """Checks a name for a new instance.

        Raises:
            FieldError: it is not a valid name, or is already used.
        """
        require_name(name)
        if name in state.instances:
            raise FieldError(f"name {name!r} is used already; choose another one")
        if name in self.taken_names(state):
            raise FieldError(
                f"name {name!r} is used by station {self.station.name!r}; choose another one"
            )


def find_free_place(
    polygon: Array, state: State, obstacles: Sequence[Array] = ()
) -> tuple[float, float] | None:
    """The free place for an object closest to the middle of the board.

    Args:
        polygon: (N, 2) footprint of the object, with its centre of mass above the origin [m].
        state: state with the objects that are on the board.
        obstacles: (N, 2) convex footprints of other obstacles [m].

    Returns:
        x and y of its centre of mass [m]; None if there is no room.
    """
    middle = np.array(state.document.board.size) / 2
    middle -= (polygon.min(axis=0) + polygon.max(axis=0)) / 2
    offset = find_free_offset([polygon + middle], state, obstacles)
    if offset is None:
        return None
    x, y = np.round(middle + offset, 6)
    return float(x), float(y)


def find_free_offset(
    polygons: Sequence[Array], state: State, obstacles: Sequence[Array] = ()
) -> Array | None:
    """The shortest offset that moves objects to a free place on the board.

    Args:
        polygons: (N, 2) footprint of each object now [m].
        state: state with the objects that are on the board.
        obstacles: (N, 2) convex footprints of other obstacles [m].

    Returns:
        (2,) offset [m]; None if there is no room.
    """
    clearance = 0.005  # Horizontal distance between new objects and others, in metres.
    size = np.array(state.document.board.size)
    pitch = max(0.01, float(size.max()) / 60)  # Metres between the places that are tried.
    ticks = [np.arange(-(s // pitch), s // pitch + 1) * pitch for s in size]
    offsets = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    offsets = offsets[np.argsort((offsets**2).sum(axis=1), kind="stable")]
    corners = np.concatenate(list(polygons))
    lower, upper = corners.min(axis=0) + offsets, corners.max(axis=0) + offsets
    offsets = offsets[((lower >= 0.0) & (upper <= size)).all(axis=1)]
    missing = missing_objects(state)
    others = [instance_shadow(state, name) for name in state.instances if name not in missing]
    for other in (*others, *obstacles):
        for polygon in polygons:
            if len(offsets):
                distance = distances_from_polygon(no_fit_polygon(other, polygon), offsets)
                offsets = offsets[distance >= clearance]
    return offsets[0] if len(offsets) else None
