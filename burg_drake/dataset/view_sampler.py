"""Samples views of cameras on a sphere, near those of the station, or on the wrist."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from burg_drake.cameras import Intrinsics, camera_intrinsics
from burg_drake.core import (
    Array,
    Booleans,
    InvalidInputError,
    UnknownNameError,
    inverse,
    make_pose,
    suggest_names,
    transform_points,
)
from burg_drake.dataset.camera_rays import camera_rays
from burg_drake.dataset.views import (
    DEFAULT_DEPTH_RANGE,
    SPHERE_CAMERA,
    WRIST_CAMERA,
    View,
    ViewpointSettings,
    draw_camera_on_sphere,
    jitter_camera,
)
from burg_drake.motion import (
    ArmCollision,
    ArmKinematics,
    arm_solutions,
    require_free_home,
    solve_ik,
)
from burg_drake.objects import ObjectEntry
from burg_drake.scene import Scene, SceneLike, as_scene
from burg_drake.station import (
    Station,
    StationLike,
    as_station,
    build_station_diagram,
    obstacle_boxes,
    table_box,
)


@dataclass(frozen=True, eq=False)
class PlacedBox:
    """A box in the scene.

    Attributes:
        name: name of the body that the box is or bounds.
        X_SB: (4, 4) pose of the box's centre.
        half: (3,) half extents [m].
    """

    name: str
    X_SB: Array
    half: Array

    def contains(self, p_SQ: Array) -> bool:
        """Whether a point (3,) is in the box."""
        p_BQ = transform_points(inverse(self.X_SB), p_SQ[None])[0]
        return bool((np.abs(p_BQ) < self.half).all())

    def occludes(self, p_SC: Array, p_SQ: Array) -> Booleans:
        """(N,) whether the box blocks the line of sight from a point (3,) to points (N, 3), by a
        slab test."""
        tolerance = 1e-6  # Share of the line at either end in which contact does not count.
        X_BS = inverse(self.X_SB)
        start = transform_points(X_BS, p_SC[None])
        along = transform_points(X_BS, p_SQ) - start
        along = np.where(np.abs(along) < 1e-12, 1e-12, along)
        one, other = (-self.half - start) / along, (self.half - start) / along
        enters = np.minimum(one, other).max(axis=1)
        leaves = np.maximum(one, other).min(axis=1)
        return np.asarray(
            (enters < leaves - tolerance) & (leaves > tolerance) & (enters < 1.0 - tolerance)
        )


def box_around(name: str, entry: ObjectEntry, X_SO: Array) -> PlacedBox:
    """Bounding box of an object of a library at a pose (4, 4), along the object's axes."""
    lower, upper = np.array(entry.lower), np.array(entry.upper)
    X_SB = X_SO.copy()
    X_SB[:3, 3] = transform_points(X_SO, 0.5 * (lower + upper)[None])[0]
    return PlacedBox(name, X_SB, 0.5 * (upper - lower))


class WristCamera:
    """An arm with a camera on its hand, in one scene.

    Attributes:
        X_HC: (4, 4) pose of the optical frame in the hand's frame.
    """

    def __init__(self, scene: Scene, station: Station, X_HC: Array | None = None) -> None:
        """Builds the arm and its obstacles, which takes about a second.

        Args:
            scene: obstacles of the arm.
            station: station with the arm.
            X_HC: (4, 4) pose of the optical frame in the hand's frame; the usual pose if None.

        Raises:
            InvalidInputError: the station has no arm, or the arm collides at home.
        """
        arm = station.document.arm
        if arm is None:
            raise InvalidInputError(
                f"a wrist camera needs an arm, but station {station.name!r} ({station.path}) has"
                " none; view the scene from 'sphere' or a camera of the station"
            )
        built = build_station_diagram(scene, station, robot="arm", weld_objects=True)
        self._collision = ArmCollision(built)
        require_free_home(built, self._collision)
        self._kinematics = ArmKinematics.of(built)
        self._solutions = arm_solutions(self._kinematics, redundant=(16,), limit_margin=0.01)
        self._home = np.array(arm.home)
        self._X_AS = inverse(arm.X_WA.matrix()) @ station.document.X_WS.matrix()
        if X_HC is None:  # beside the hand, with the fingertips at the image's lower edge
            X_HC = np.asarray(station.hand.X_HG.matrix() @ make_pose(p_AB=(0.0, -0.07, -0.09)))
        self.X_HC = X_HC

    def find_posture(self, X_SC: Array) -> Array | str:
        """Finds the collision-free joint positions (n,) nearest to home that bring the camera to a
        pose (4, 4), or the reason why there are none."""
        X_AH = self._X_AS @ X_SC @ inverse(self.X_HC)
        found = [
            self._solutions.solve(X_AH[None], turn)[1] for turn in range(self._solutions.rounds)
        ]
        solutions, converged = solve_ik(
            self._kinematics,
            np.broadcast_to(X_AH, (sum(map(len, found)), 4, 4)),
            np.concatenate(found),
            iterations=5,
            tolerance=1e-9,
        )
        q = self._kinematics.wrapped_near(solutions[converged], self._home)
        if not len(q):
            return "are out of the arm's reach"
        home_distance = np.abs(q - self._home).max(axis=1)
        for one in q[np.argsort(home_distance, kind="stable")[:12]]:  # nearest first
            if self._collision.is_free(one):
                return np.asarray(one)
        return "have the arm collide"


class ViewSampler:
    """Views of one scene on one station.

    Attributes:
        settings: ranges from which views are drawn.
    """

    def __init__(
        self,
        scene: SceneLike,
        station: StationLike,
        settings: ViewpointSettings | None = None,
        *,
        intrinsics: Intrinsics | None = None,
        depth_range: tuple[float, float] | None = None,
        besides: Sequence[PlacedBox] = (),
    ) -> None:
        """Checks that the station has the cameras of the settings.

        Args:
            scene: scene in view.
            station: station of the scene, with cameras and arm.
            settings: ranges from which views are drawn.
            intrinsics: intrinsics of all cameras. If None, cameras of the station have their own;
                cameras on the sphere and the wrist have those of the station's first camera.
            depth_range: nearest and farthest depth [m]. If None, the depth range of the camera that
                gives the intrinsics, or `DEFAULT_DEPTH_RANGE` with given intrinsics.
            besides: further boxes in the scene frame. Cameras on the sphere and the wrist stay
                outside these boxes and must see past them; cameras of the station are not checked.

        Raises:
            UnknownNameError: the station has no such camera.
            InvalidInputError: the scene is empty; no intrinsics are given and the station has no
                camera; or the settings name the wrist, and the station has no arm.
        """
        self.settings = settings or ViewpointSettings()
        self._scene, self._station = as_scene(scene), as_station(station)
        self._given_intrinsics, self._depth_range = intrinsics, depth_range
        self._besides = tuple(besides)
        require_cameras(self.settings, self._station)
        known = self._station.document.cameras
        if intrinsics is None and not known:
            raise InvalidInputError(
                f"station {self._station.name!r} ({self._station.path}) has no camera whose"
                " intrinsics the views could use; give intrinsics"
            )
        if not len(self._objects):
            raise InvalidInputError(f"scene {self._scene.name!r} ({self._scene.path}) is empty")
        if WRIST_CAMERA in self.settings.cameras:
            _ = self._wrist

    def sample(self, rng: np.random.Generator, camera: str | None = None) -> View:
        """Draws a view.

        Args:
            rng: random numbers; the same state gives the same view.
            camera: a camera of the settings; drawn if None.

        Raises:
            InvalidInputError: no draw fulfils the rules; the message counts the draws that broke
                each rule.
            UnknownNameError: the settings have no such camera.
        """
        cameras = self.settings.cameras
        if camera is None:
            camera = cameras[int(rng.integers(len(cameras)))]
        elif camera not in cameras:
            raise UnknownNameError(
                f"views cannot be from camera {camera!r}; {suggest_names(camera, cameras)}"
            )
        refused: Counter[str] = Counter()
        is_fixed = camera in self._station.document.cameras and not (
            self.settings.position_jitter or self.settings.angle_jitter_deg
        )
        for _ in range(1 if is_fixed else self.settings.draws):
            view = self._draw(camera, rng)
            if isinstance(view, View):
                return view
            refused[view] += 1
        why = "; ".join(f"{count} {reason}" for reason, count in refused.most_common())
        raise InvalidInputError(
            f"no view of scene {self._scene.name!r} ({self._scene.path}) was found: of"
            f" {refused.total()} views from {camera!r}, {why}; move the camera or the objects, or"
            " allow views from nearer"
        )

    def _draw(self, camera: str, rng: np.random.Generator) -> View | str:
        """A view, or the rule that it breaks."""
        known = self._station.document.cameras
        intrinsics, depth_range = self._optics(camera)
        solids = self._solids if camera in known else (*self._solids, *self._besides)
        if camera in known:
            X_SW = inverse(self._station.document.X_WS.matrix())
            X_SC = jitter_camera(X_SW @ known[camera].X_WC.matrix(), self.settings, rng)
        else:
            X_SC = draw_camera_on_sphere(self.settings, self._p_SO.mean(axis=0), rng)
        view = View(camera=camera, intrinsics=intrinsics, X_SC=X_SC, depth_range=depth_range)
        broken = self._broken_rule(view, solids)
        if broken:
            return broken
        if camera != WRIST_CAMERA:
            return view
        posture = self._wrist.find_posture(X_SC)
        if isinstance(posture, str):
            return posture
        return replace(view, posture=tuple(posture.tolist()))

    def _optics(self, camera: str) -> tuple[Intrinsics, tuple[float, float]]:
        """Intrinsics and depth range of a camera."""
        known = self._station.document.cameras
        if self._given_intrinsics is not None:
            return self._given_intrinsics, self._depth_range or DEFAULT_DEPTH_RANGE
        document = known.get(camera) or next(iter(known.values()))
        return camera_intrinsics(document), self._depth_range or document.depth_range

    def _broken_rule(self, view: View, solids: Sequence[PlacedBox]) -> str:
        """The visibility rule that a view breaks, in words; empty if none."""
        p_SC = view.X_SC[:3, 3]
        for box in (*solids, *self._objects):
            if box.contains(p_SC):
                return f"have the camera in {box.name!r}"
        wanted = max(1, int(np.ceil(self.settings.in_view * len(self._p_SO) - 1e-9)))
        if self._count_visible(view, solids) < wanted:
            return f"show fewer than {wanted} of {len(self._p_SO)} objects"
        return ""

    def _count_visible(self, view: View, solids: Sequence[PlacedBox]) -> int:
        """Number of objects whose centres are in the image and the depth range, and not occluded
        by the solids."""
        p_SO, intrinsics = self._p_SO, view.intrinsics
        p_CO = transform_points(inverse(view.X_SC), p_SO)
        near, far = view.depth_range
        seen = (p_CO[:, 2] >= near) & (p_CO[:, 2] <= far)
        seen &= camera_rays(intrinsics).sees(p_CO)
        pixel = np.full((len(p_CO), 2), -1.0)
        pixel[seen] = intrinsics.project(p_CO[seen])
        size = np.array((intrinsics.width, intrinsics.height))
        seen &= ((pixel >= -0.5) & (pixel <= size - 0.5)).all(axis=1)
        for box in solids:
            seen &= ~box.occludes(view.X_SC[:3, 3], p_SO)
        return int(seen.sum())

    @cached_property
    def _solids(self) -> tuple[PlacedBox, ...]:
        """Boxes of the table and the obstacles."""
        X_SW = inverse(self._station.document.X_WS.matrix())
        boxes = {"table": table_box(self._station), **obstacle_boxes(self._station)}
        return tuple(
            PlacedBox(name, X_SW @ box.X_WB, np.array(box.size) / 2) for name, box in boxes.items()
        )

    @cached_property
    def _objects(self) -> tuple[PlacedBox, ...]:
        """Bounding boxes of all instances, along the axes of each: free ones, then background."""
        return tuple(
            box_around(name, self._scene.entry(name), self._scene.X_SO(name))
            for name in (*self._scene.instances, *self._scene.background)
        )

    @cached_property
    def _p_SO(self) -> Array:
        """(N, 3) centres of the free instances, or of the background if there are none [m]."""
        seen = self._objects[: len(self._scene.instances)] or self._objects
        return np.array([box.X_SB[:3, 3] for box in seen]).reshape(-1, 3)

    @cached_property
    def _wrist(self) -> WristCamera:
        X_HC = self.settings.X_HC
        return WristCamera(self._scene, self._station, None if X_HC is None else X_HC.matrix())


def require_cameras(settings: ViewpointSettings, station: Station) -> None:
    """Refuses cameras that a station does not have.

    Raises:
        UnknownNameError: there is no such camera.
    """
    known = (SPHERE_CAMERA, WRIST_CAMERA, *station.document.cameras)
    for name in settings.cameras:
        if name not in known:
            raise UnknownNameError(
                f"station {station.name!r} ({station.path}) has no camera {name!r};"
                f" {suggest_names(name, known)}"
            )
