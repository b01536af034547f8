"""Images for the tests of the live view."""

from __future__ import annotations

import threading
from functools import cache

import numpy as np

from burg_drake.cameras import Frame, FrameSource, Intrinsics
from burg_drake.core import make_pose
from burg_drake.scene import load_scene
from tests.cameras.synthetic import board_image

CAMERA = Intrinsics(width=320, height=240, focal=(300.0, 300.0), center=(159.5, 119.5))
X_SC = make_pose(np.diag([1.0, -1.0, -1.0]), (0.3, 0.21, 0.6))


@cache
def photo() -> np.ndarray:
    """(240, 320, 3) RGB: the board of the scene `tabletop_six`, nothing on it."""
    return board_image(load_scene("tabletop_six").board, CAMERA, X_SC)


class Camera(FrameSource):
    """The same image 20 times a second."""

    def __init__(self, image: np.ndarray) -> None:
        self.name, self.live, self.size, self.image = "camera 7", True, (320, 240), image
        self._closed, self._time = threading.Event(), 0.0

    def read(self) -> Frame | None:
        if self._closed.wait(0.05):
            return None
        self._time += 0.05
        return Frame(self.image, None, self._time, self.name)

    def close(self) -> None:
        self._closed.set()
