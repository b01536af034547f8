"""Pictures that worker processes compute: of objects, and of the area that the arm reaches."""

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
Wanted = tuple[str, int | None]
"""An object, and in which stable pose; None: as it looks best."""

_log = logging.getLogger("burg_drake")


class ObjectPictures:
    """Pictures of one library.

    Args:
        library: where the objects are.
        on_ready: called in a thread of this class's when a picture is there.

    Attributes:
        missing: why there are no pictures, in one line; empty if there are.
    """

    def __init__(self, library: ObjectLibrary, on_ready: Callable[[Wanted], None]) -> None:
        self.library = library
        self.missing = ""
        self._on_ready = on_ready
        self._known: dict[Wanted, bytes | None] = {}
        self._wanted: list[Wanted] = []
        self._condition = threading.Condition()
        self._closed = False
        self._worker = WorkerPool(1, retries=0)
        self._thread = threading.Thread(target=self._run, name="object-pictures", daemon=True)
        self._thread.start()

    def get(self, name: str, stable_pose: int | None = None) -> bytes | None:
        """A PNG, if it is there; else it is made, the newest wish first."""
        wanted = (name, stable_pose)
        with self._condition:
            if wanted in self._known:
                return self._known[wanted]
            if wanted in self._wanted:
                self._wanted.remove(wanted)
            self._wanted.append(wanted)
            self._condition.notify()
        return None

    def close(self) -> None:
        """Ends thread and process."""
        with self._condition:
            self._closed = True
            self._condition.notify()
        self._worker.kill_workers()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._condition:
                self._condition.wait_for(lambda: bool(self._wanted) or self._closed)
                if self._closed:
                    return
                wanted = self._wanted[-1]
            png = self._picture(wanted)
            with self._condition:
                self._known[wanted] = png
                self._wanted.remove(wanted)
                if self._closed:
                    return
            self._on_ready(wanted)

    def _picture(self, wanted: Wanted) -> bytes | None:
        name, stable_pose = wanted
        if self.missing:
            return None
        try:
            content = content_hash(self.library.content[name], str(stable_pose), list(PICTURE_SIZE))
            arrays = cached("picture", content, lambda: {"png": self._render(wanted)})
            return bytes(np.asarray(arrays["png"], dtype=np.uint8))
        except MissingDependencyError as error:
            self.missing = f"no pictures: {error}"
        except (BurgError, OSError) as error:
            _log.debug("no picture of %s: %s", name, error)
        return None

    def _render(self, wanted: Wanted) -> np.ndarray[Any, np.dtype[np.uint8]]:
        if missing := missing_render_libraries():
            raise MissingDependencyError(describe_missing(missing))
        try:
            png = self._worker.submit(
                render_picture, str(self.library.root), *wanted, PICTURE_SIZE
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
        name: of the object.
        stable_pose: in which it stands; None: as it looks best.
        size: width and height [pixel].

    Raises:
        BurgError: it cannot be rendered.
    """
    from burg_drake.objects import load_library
    from burg_drake.visualization import ObjectRenderer

    renderer = ObjectRenderer(load_library(root), [name])
    return renderer.portrait(name, size, stable_pose=stable_pose).png()


@dataclass(frozen=True)
class ReachTask:
    """Asks for a layer.

    Attributes:
        station: with an arm.
        board: under the grasps.
        height: of the grasps above the board [m].
    """

    station: Station
    board: Board
    height: float

    def __call__(self, report: Callable[[float, str], None]) -> ReachLayer:
        from burg_drake.motion import reach_from_above

        return reach_from_above(self.station, self.board, height=self.height)
