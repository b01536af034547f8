"""A video file as a source of frames."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from burg_drake.cameras.sources.frame import Frame, FrameSource, Image
from burg_drake.cameras.sources.opencv_log import quiet
from burg_drake.core import InvalidInputError

BROKEN_IN_A_ROW = 100
"""Frames that may be unreadable before the rest of a file counts as lost."""

DEFAULT_FPS = 30.0
"""Where the file tells none."""


class VideoSource(FrameSource):
    """A video file, frame by frame; as with photographs, notes how to turn it are not followed.

    Args:
        path: of the file.

    Attributes:
        broken: frames so far that could not be read and were left out.

    Raises:
        InvalidInputError: it cannot be read as a video.
    """

    def __init__(self, path: str | Path) -> None:
        path = Path(path)
        if not path.is_file():
            raise InvalidInputError(f"video or image {path} does not exist")
        with quiet():
            self._capture = cv2.VideoCapture(str(path), cv2.CAP_ANY)
            self._capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
        self.name, self.live = path.name, False
        self.broken = 0
        self._taken = 0
        self.fps = self._capture.get(cv2.CAP_PROP_FPS) or DEFAULT_FPS
        self._count = int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT))
        self._ahead = self._next_image() if self._capture.isOpened() else None
        if self._ahead is None:
            raise InvalidInputError(f"{path} is empty, or cannot be read as a video or image")
        self.size = (self._ahead.shape[1], self._ahead.shape[0])

    def __len__(self) -> int:
        """Frames that the file says it has."""
        return self._count

    def read(self) -> Frame | None:
        """See `FrameSource.read`."""
        image, self._ahead = self._ahead, None
        if image is None:
            image = self._next_image()
        if image is None:
            return None
        number = self._taken - 1
        return Frame(
            image, None, number / (self.fps or DEFAULT_FPS), f"{self.name}, frame {number}"
        )

    def close(self) -> None:
        """Closes the file."""
        self._ahead = None
        self._capture.release()

    def _next_image(self) -> Image | None:
        """The next frame that can be read; None at the end."""
        for _ in range(BROKEN_IN_A_ROW):
            good, bgr = self._capture.read()
            if good and bgr is not None and bgr.size:
                self._taken += 1
                return np.ascontiguousarray(bgr[..., ::-1])
            if self._taken + 1 >= self._count:
                return None
            self._taken += 1
            self.broken += 1
        return None
