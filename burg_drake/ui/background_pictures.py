"""Pictures computed in worker processes: of objects, and of the area that the arm reaches."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from burg_drake.core import (
    BurgError,
    MissingDependencyError,
    WorkerDied,
    WorkerPool,
    cached,
    content_hash,
)
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import Board
from burg_drake.station import Station
from burg_drake.system_libraries import describe_missing, missing_render_libraries

if TYPE_CHECKING:
    from burg_drake.motion import ReachLayer

PICTURE_SIZE = (176, 132)
"""Width and height in pixels; shown at half of that on fine screens."""
PictureKey = tuple[str, int | None]
"""An object and its stable pose; None for the best view."""

_log = logging.getLogger("burg_drake")


class ObjectPictures:
    """Pictures of the objects of a library.

    Args:
        library: library of the objects.
        on_ready: called with the key of each finished picture, in a thread of this class.

    Attributes:
        missing: why there are no pictures, in one line; empty if there are some.
    """

    def __init__(self, library: ObjectLibrary, on_ready: Callable[[PictureKey], None]) -> None:
        self.library = library
        self.missing = ""
        self._on_ready = on_ready
        self._pictures: dict[PictureKey, bytes | None] = {}
        self._queue: list[PictureKey] = []
        self._condition = threading.Condition()
        self._closed = False
        self._worker = WorkerPool(1, retries=0)
        self._thread = threading.Thread(target=self._run, name="object-pictures", daemon=True)
        self._thread.start()

    def get(self, name: str, stable_pose: int | None = None) -> bytes | None:
        """The PNG if it is finished; else None, and it is queued, the newest request first."""
        key = (name, stable_pose)
        with self._condition:
            if key in self._pictures:
                return self._pictures[key]
            if key in self._queue:
                self._queue.remove(key)
            self._queue.append(key)
            self._condition.notify()
        return None

    def close(self) -> None:
        """Ends the thread and the worker process."""
        with self._condition:
            self._closed = True
            self._condition.notify()
        self._worker.kill_workers()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._condition:
                self._condition.wait_for(lambda: bool(self._queue) or self._closed)
                if self._closed:
                    return
                key = self._queue[-1]
            png = self._load_or_render(key)
            with self._condition:
                self._pictures[key] = png
                self._queue.remove(key)
                if self._closed:
                    return
            self._on_ready(key)

    def _load_or_render(self, key: PictureKey) -> bytes | None:
        name, stable_pose = key
        if self.missing:
            return None
        try:
            content = content_hash(self.library.content[name], str(stable_pose), list(PICTURE_SIZE))
            arrays = cached("picture", content, lambda: {"png": self._render(key)})
            return bytes(np.asarray(arrays["png"], dtype=np.uint8))
        except MissingDependencyError as error:
            self.missing = f"no pictures: {error}"
        except (BurgError, OSError) as error:
            _log.debug("no picture of %s: %s", name, error)
        return None

    def _render(self, key: PictureKey) -> np.ndarray[Any, np.dtype[np.uint8]]:
        if missing := missing_render_libraries():
            raise MissingDependencyError(describe_missing(missing))
        try:
            png = self._worker.submit(
                render_picture, str(self.library.root), *key, PICTURE_SIZE
            ).result()
        except Exception as error:
            if self._closed:
                raise BurgError("the page was closed") from error
            if isinstance(error, BurgError) and not isinstance(error, WorkerDied):
                raise BurgError(str(error)) from error
            raise MissingDependencyError(str(error)) from error
        return np.frombuffer(png, dtype=np.uint8)


def render_picture(root: str, name: str, stable_pose: int | None, size: tuple[int, int]) -> bytes:
    """A PNG of an object.

    Args:
        root: folder of the library.
        name: name of the object.
        stable_pose: number of its stable pose; None for the best view.
        size: width and height [pixel].

    Raises:
        BurgError: the object cannot be rendered.
    """
    from burg_drake.objects import load_library
    from burg_drake.visualization import ObjectRenderer

    renderer = ObjectRenderer(load_library(root), [name])
    return renderer.portrait(name, size, stable_pose=stable_pose).png()


@dataclass(frozen=True)
class ReachTask:
    """Computes a layer of the arm's reach in a worker process.

    Attributes:
        station: station with an arm.
        board: board under the grasps.
        height: height of the grasps above the board [m].
    """

    station: Station
    board: Board
    height: float

    def __call__(self, report: Callable[[float, str], None]) -> ReachLayer:
        from burg_drake.motion import reach_from_above

        return reach_from_above(self.station, self.board, height=self.height)
