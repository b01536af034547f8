"""Frames and the interface of all image sources."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass

from burg_drake.core import Array, BurgError, Bytes

Image = Bytes


class CameraLost(BurgError):
    """A live camera gives no images (unplugged, another program's, no network).

    The source keeps trying; `read` again goes on with the camera as soon as it is back.
    """


@dataclass(frozen=True, eq=False)
class Frame:
    """One image of a source.

    Attributes:
        image: (H, W, 3) RGB.
        depth: (H, W) distance along the optical axis [m], NaN where nothing was measured; None if
            the source has no depth.
        time: since the source was opened; of a video file its position; of photographs their
            number [s].
        name: what a message calls it, such as `photo.png` or `camera 0`.
    """

    image: Image
    depth: Array | None
    time: float
    name: str


class FrameSource(ABC):
    """Frames one after the other.

    Attributes:
        name: what a message calls the source.
        live: it has no end, and gives its newest frame whenever it is asked.
        size: width and height of its frames [pixels]; of photographs, of the first.
        fps: frames a second, where that is known.
    """

    name: str
    live: bool
    size: tuple[int, int]
    fps: float | None = None

    @abstractmethod
    def read(self) -> Frame | None:
        """The next frame; None after the last, and when the source is closed.

        Raises:
            CameraLost: a live camera gives nothing at present. Read again, as often as you like:
                that waits a moment for the camera to come back, so that no loop is a busy one.
            InvalidInputError: one file of several cannot be read. Read again for the next.
        """

    @abstractmethod
    def close(self) -> None:
        """Lets go of the camera or file; another thread's `read` returns None."""

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
