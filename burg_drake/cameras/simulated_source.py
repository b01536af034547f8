"""A simulated camera of a station as a source of frames with depth."""

from __future__ import annotations

import gc
import math
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from burg_drake.cameras.frame_source import Frame, FrameSource
from burg_drake.cameras.intrinsics_file import DEFAULT_CAMERA, SIMULATED_PREFIX
from burg_drake.core import Array, Bytes
from burg_drake.scene import Scene
from burg_drake.station import Station, build_station_diagram

SIMULATED_FPS = 10.0  # Frames per second of simulated cameras.


class SimulatedSource(FrameSource):
    """A simulated camera of a station over a scene with all objects at their targets.

    It renders in its own thread, so that any thread may read: a renderer belongs to the thread that
    created it.

    Args:
        scene: objects on the board.
        station: station with the camera; its robot is left out.
        camera: name of the camera.
        fps: frames a second, in simulated time and, if `live`, in real time.
        X_WC: returns the camera's pose (4, 4) at a time [s]; the station's pose if not given.
        live: give frames at `fps`, as a real camera; else as fast as they are rendered.

    Attributes:
        station, camera: as given.

    Raises:
        UnknownNameError: the station has no such camera.
        MissingDependencyError: a system library of the renderer is missing.
    """

    def __init__(
        self,
        scene: Scene,
        station: Station,
        camera: str = DEFAULT_CAMERA,
        *,
        fps: float = SIMULATED_FPS,
        X_WC: Callable[[float], Array] | None = None,
        live: bool = True,
    ) -> None:
        document = station.camera(camera)
        self.name, self.live, self.fps = f"{SIMULATED_PREFIX}{station.name}/{camera}", live, fps
        self.station, self.camera = station, camera
        self.size = (document.width, document.height)
        self._X_WC = X_WC
        self._closed = threading.Event()
        self._thread = ThreadPoolExecutor(max_workers=1)
        self._renderer: _Renderer | None = None
        try:
            self._thread.submit(self._build, scene).result()
        except BaseException:
            self._thread.shutdown()
            raise
        self._number = 0
        self._start = time.monotonic()

    def read(self) -> Frame | None:
        """See `FrameSource.read`; depth as Drake's sensor gives it, without noise."""
        max_delay = 2.0  # Seconds by which simulated time may lag before frames are skipped.
        moment = self._number / (self.fps or SIMULATED_FPS)
        if self.live:
            ahead = self._start + moment - time.monotonic()
            if ahead < -max_delay:  # no reads for a while: catch up with real time
                self._number = math.ceil((moment - ahead) * (self.fps or SIMULATED_FPS))
                return self.read()
            self._closed.wait(ahead)
        if self._closed.is_set():
            return None
        self._number += 1
        try:
            return self._thread.submit(self._render, moment).result()
        except RuntimeError:
            if self._closed.is_set():  # closed by another thread just now
                return None
            raise

    def close(self) -> None:
        """No more frames."""
        if not self._closed.is_set():
            self._closed.set()
            gc.collect()  # a render engine must be destroyed in its own thread
            self._thread.submit(self._release_renderer)
            self._thread.shutdown()

    def _build(self, scene: Scene) -> None:
        self._renderer = _Renderer(scene, self.station, self.camera)

    def _render(self, moment: float) -> Frame | None:
        if self._renderer is None:
            return None
        image, depth = self._renderer.render(
            moment, None if self._X_WC is None else self._X_WC(moment)
        )
        return Frame(image, depth, moment, self.name)

    def _release_renderer(self) -> None:
        self._renderer = None
        gc.collect()


class _Renderer:
    """Renders one camera of a station's diagram."""

    def __init__(self, scene: Scene, station: Station, camera: str) -> None:
        self._diagram = build_station_diagram(scene, station, robot="none", cameras=True).diagram
        self._context = self._diagram.CreateDefaultContext()
        self._camera = f"camera.{camera}"

    def render(self, moment: float, X_WC: Array | None) -> tuple[Bytes, Array]:
        """Colour (H, W, 3) and depth (H, W) at a time, from the given or the station's camera
        pose.
        """
        self._context.SetTime(moment)
        if X_WC is not None:
            sensor = self._diagram.GetSubsystemByName(self._camera)
            mine = sensor.GetMyMutableContextFromRoot(self._context)
            sensor.SetX_PB(mine, RigidTransform(X_WC))
        depth = self._pixels("depth_image")[..., 0].astype(float)
        depth[~np.isfinite(depth) | (depth <= 0.0)] = np.nan
        return np.ascontiguousarray(self._pixels("color_image")[..., :3]), depth

    def _pixels(self, image: str) -> NDArray[Any]:
        port = self._diagram.GetOutputPort(f"{self._camera}.{image}")
        return np.asarray(port.Eval(self._context).data)
