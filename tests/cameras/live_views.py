"""What the tests of running sessions share."""

from __future__ import annotations

import numpy as np

from burg_drake.cameras import EventLog, Frame, FrameSource, Intrinsics
from burg_drake.core import make_pose

CAMERA = Intrinsics(width=320, height=240, focal=(300.0, 300.0), center=(159.5, 119.5))


def camera_at(x: float) -> np.ndarray:
    """Straight above the board."""
    return make_pose(np.diag([1.0, -1.0, -1.0]), (x, 0.21, 0.6))


def lines(log: EventLog) -> list[str]:
    return [event.text for event in log.after(0)]


class Pictures(FrameSource):
    """Any frames, as fast as they are taken."""

    def __init__(self, *images: np.ndarray, live: bool = False) -> None:
        self.name, self.live, self.size, self.images = "pictures", live, (320, 240), list(images)
        self.given = 0

    def read(self) -> Frame | None:
        if self.given == len(self.images):
            return None
        self.given += 1
        return Frame(self.images[self.given - 1], None, 1.0 * self.given, f"picture {self.given}")

    def close(self) -> None:
        self.given = len(self.images)
