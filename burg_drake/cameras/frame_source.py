"""Frames and the interface of all image sources."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array, BurgError, Bytes, InvalidInputError

Image = Bytes


def require_rgb(image: Image) -> None:
    """Rejects arrays that are no RGB image (H, W, 3).

    Raises:
        InvalidInputError: the array has another shape or type.
    """
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        raise InvalidInputError(
            f"the image has shape {image.shape} and type {image.dtype}; expected RGB, (H, W, 3)"
            " uint8"
        )


class CameraLost(BurgError):
    """A live camera gives no images (unplugged, used by another program, no network).

    The source keeps trying to reconnect; call `read` again to continue.
    """


@dataclass(frozen=True, eq=False)
class Frame:
    """One image of a source.

    Attributes:
        image: (H, W, 3) RGB.
        depth: (H, W) distance along the optical axis [m], NaN where nothing was measured; None if
            the source has no depth.
        time: time since the source was opened; position in a video file; number of a photograph
            [s].
        name: name in messages, such as `photo.png` or `camera 0`.
    """

    image: Image
    depth: Array | None
    time: float
    name: str


class FrameSource(ABC):
    """A source of successive frames.

    Attributes:
        name: name in messages.
        live: the source has no end, and `read` returns its newest frame.
        size: width and height of its frames [pixels]; of photographs, of the first.
        fps: frames per second, if known.
    """

    name: str
    live: bool
    size: tuple[int, int]
    fps: float | None = None

    @abstractmethod
    def read(self) -> Frame | None:
        """The next frame; None after the last, and when the source is closed.

        Raises:
            CameraLost: a live camera gives no images. Call again, in a loop if you like: each call
                waits a moment for the camera to come back.
            InvalidInputError: one file of several cannot be read. Call again for the next one.
        """

    @abstractmethod
    def close(self) -> None:
        """Releases the camera or file; another thread's `read` returns None."""

    def __iter__(self) -> Iterator[Frame]:
        """Frames to the end; waits while a camera is away."""
        while True:
            try:
                frame = self.read()
            except CameraLost:
                continue
            if frame is None:
                return
            yield frame

    def __enter__(self) -> FrameSource:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
