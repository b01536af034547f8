"""Draws views of a scene that show something."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from burg_drake.cameras.optics import FieldOfView, Intrinsics, of_camera
from burg_drake.core import (
    Array,
    InvalidInputError,
    UnknownNameError,
    inverse,
    nearest,
    transform_points,
)
from burg_drake.dataset.views.places import draw_on_sphere, jittered
from burg_drake.dataset.views.settings import SPHERE, WRIST, ViewpointSettings
from burg_drake.dataset.views.surroundings import PlacedBox, ViewedScene
from burg_drake.dataset.views.view import DEPTH_RANGE, View
from burg_drake.dataset.views.wrist import WristCamera
from burg_drake.scene.document import SceneLike, as_scene
from burg_drake.station.document import Station, StationLike, as_station


class ViewSampler:
    """Views of one scene on one station.

    Attributes:
        settings: how they are drawn.
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
        """Checks that there are such cameras.

        Args:
            scene: that is looked at.
            station: what it stands on; has cameras and arm.
            settings: how views are drawn.
            intrinsics: of all cameras; if None those of the station have their own, and those on
                sphere and wrist have them from the first camera of the station.
            depth_range: nearest and farthest depth [m]; that of the same camera, or `DEPTH_RANGE`
                with given intrinsics, if None.
            besides: boxes in the scene frame around what belongs to neither: cameras on sphere and
                wrist are not in them, and see past them. Those of the station stand where they do.

        Raises:
            UnknownNameError: the station has no such camera.
            InvalidInputError: the scene is empty; no intrinsics are given and the station has no
                camera to take them from; or a wrist is wanted of a station without an arm.
        """
        self.settings = settings or ViewpointSettings()
        self._scene, self._station = as_scene(scene), as_station(station)
        self._seen = ViewedScene(self._scene, self._station)
        self._given, self._depth_range = intrinsics, depth_range
        self._besides = tuple(besides)
        self._fields: dict[Intrinsics, FieldOfView] = {}
        require_cameras(self.settings, self._station)
        known = self._station.document.cameras
        if intrinsics is None and not known:
            raise InvalidInputError(
                f"station {self._station.name!r} ({self._station.path}) has no camera whose"
                " intrinsics the views could use; give intrinsics"
            )
        if not len(self._seen.objects):
            raise InvalidInputError(f"scene {self._scene.name!r} ({self._scene.path}) is empty")
        if WRIST in self.settings.cameras:
            _ = self._wrist

    def sample(self, rng: np.random.Generator, camera: str | None = None) -> View:
        """Draws a view.

        Args:
            rng: draws; the same one gives the same view.
            camera: one of those in the settings; drawn if None.

        Raises:
            InvalidInputError: none of so many draws fulfils the rules; the message says which of
                them how many of the draws broke.
            UnknownNameError: the settings have no such camera.
        """
        cameras = self.settings.cameras
        if camera is None:
            camera = cameras[int(rng.integers(len(cameras)))]
        elif camera not in cameras:
            raise UnknownNameError(
                f"views cannot be from camera {camera!r}; {nearest(camera, cameras)}"
            )
        refused: Counter[str] = Counter()
        still = camera in self._station.document.cameras and not (
            self.settings.position_jitter or self.settings.angle_jitter_deg
        )
        for _ in range(1 if still else self.settings.draws):
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
        """A view, or which rule it breaks."""
        known = self._station.document.cameras
        intrinsics, depth_range = self._optics(camera)
        solids = self._seen.solids if camera in known else (*self._seen.solids, *self._besides)
        if camera in known:
            X_SW = inverse(self._station.document.X_WS.matrix())
            X_SC = jittered(X_SW @ known[camera].X_WC.matrix(), self.settings, rng)
        else:
            X_SC = draw_on_sphere(self.settings, self._seen.p_SO.mean(axis=0), rng)
        broken = self._broken_rule(X_SC, intrinsics, depth_range, solids)
        if broken:
            return broken
        posture = self._wrist.posture(X_SC) if camera == WRIST else None
        if isinstance(posture, str):
            return posture
        return View(
            camera=camera,
            intrinsics=intrinsics,
            X_SC=X_SC,
            depth_range=depth_range,
            posture=None if posture is None else tuple(posture.tolist()),
        )

    def _optics(self, camera: str) -> tuple[Intrinsics, tuple[float, float]]:
        """Intrinsics and range of depths of a camera."""
        known = self._station.document.cameras
        if self._given is not None:
            return self._given, self._depth_range or DEPTH_RANGE
        document = known.get(camera) or next(iter(known.values()))
        return of_camera(document), self._depth_range or document.depth_range

    def _broken_rule(
        self,
        X_SC: Array,
        intrinsics: Intrinsics,
        depth_range: tuple[float, float],
        solids: Sequence[PlacedBox],
    ) -> str:
        """Which rule of what is seen a camera breaks, in words; empty if none."""
        p_SC = X_SC[:3, 3]
        for box in (*solids, *self._seen.objects):
            if box.contains(p_SC):
                return f"have the camera in {box.name!r}"
        wanted = max(1, int(np.ceil(self.settings.in_view * len(self._seen.p_SO) - 1e-9)))
        if self._shown(X_SC, intrinsics, depth_range, solids) < wanted:
            return f"show fewer than {wanted} of {len(self._seen.p_SO)} objects"
        return ""

    def _shown(
        self,
        X_SC: Array,
        intrinsics: Intrinsics,
        depth_range: tuple[float, float],
        solids: Sequence[PlacedBox],
    ) -> int:
        """How many objects have their centres in the image and the range of depths, with none of
        the solids before them."""
        p_SO = self._seen.p_SO
        p_CO = transform_points(inverse(X_SC), p_SO)
        near, far = depth_range
        seen = (p_CO[:, 2] >= near) & (p_CO[:, 2] <= far)
        field = self._fields.setdefault(intrinsics, FieldOfView(intrinsics))
        seen &= field.sees(p_CO)
        pixel = np.full((len(p_CO), 2), -1.0)
        pixel[seen] = intrinsics.project(p_CO[seen])
        size = np.array((intrinsics.width, intrinsics.height))
        seen &= ((pixel >= -0.5) & (pixel <= size - 0.5)).all(axis=1)
        for box in solids:
            seen &= ~box.hides(X_SC[:3, 3], p_SO)
        return int(seen.sum())

    @cached_property
    def _wrist(self) -> WristCamera:
        X_HC = self.settings.X_HC
        return WristCamera(self._scene, self._station, None if X_HC is None else X_HC.matrix())


def require_cameras(settings: ViewpointSettings, station: Station) -> None:
    """Refuses cameras that a station does not have.

    Raises:
        UnknownNameError: there is no such camera.
    """
    known = (SPHERE, WRIST, *station.document.cameras)
    for name in settings.cameras:
        if name not in known:
            raise UnknownNameError(
                f"station {station.name!r} ({station.path}) has no camera {name!r};"
                f" {nearest(name, known)}"
            )
