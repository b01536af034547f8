"""A real camera, or a network stream, through OpenCV.

A thread takes images as they come and keeps the newest, so that a reader who is slow does not see
the past. The same thread opens the camera again after it was lost.
"""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator

import cv2
import numpy as np

from burg_drake.cameras.sources.frame import CameraLost, Frame, FrameSource, Image
from burg_drake.cameras.sources.opencv_log import quiet
from burg_drake.core import InvalidInputError

PATIENCE = 2.0
"""A camera that gives no image for that long counts as lost [s]."""
FIRST_WAIT, LONGEST_WAIT = 0.5, 5.0
"""Between attempts to open a lost camera again; doubled after each [s]."""

PLUGGED = (
    "is it plugged in, is no other program using it, and do you have permission to read it?"
    " `burg-drake camera list` shows which cameras open"
)
ON_AIR = "is the address right, is it reachable on the network, and does it send video?"
"""What to look at where a camera, or a stream, does not open."""

BACKENDS = {"linux": cv2.CAP_V4L2, "darwin": cv2.CAP_AVFOUNDATION}
"""For cameras of this machine."""
NETWORK = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, 5000, cv2.CAP_PROP_READ_TIMEOUT_MSEC, 5000]
"""For streams: OpenCV would wait for half a minute."""


class DeviceSource(FrameSource):
    """A camera that OpenCV opens.

    Args:
        name: what messages call it.
        open_capture: opens it; called again when it was lost. None where it does not open.
        question: what to look at where it does not open.

    Raises:
        InvalidInputError: it does not open, or gives no images.
    """

    def __init__(
        self,
        name: str,
        open_capture: Callable[[], cv2.VideoCapture | None],
        question: str = PLUGGED,
    ) -> None:
        self.name, self.live = name, True
        self._open = open_capture
        self._start = time.monotonic()
        capture = open_capture()
        first = None if capture is None else _image(capture)
        if capture is None or first is None:
            what = "does not open" if capture is None else "opens, but gives no images"
            raise InvalidInputError(f"{name} {what}; {question}")
        self.size = (first.shape[1], first.shape[0])
        self.fps = capture.get(cv2.CAP_PROP_FPS) or None
        self._changed = threading.Condition()
        self._newest: Frame | None = None
        self._closed = threading.Event()
        self._fault = ""
        self._put(first)
        self._thread = threading.Thread(target=self._run, args=(capture,), daemon=True)
        self._thread.start()

    def read(self) -> Frame | None:
        """See `FrameSource.read`."""
        with self._changed:
            self._changed.wait_for(lambda: self._newest or self._closed.is_set(), PATIENCE)
            if self._closed.is_set():
                return None
            frame, self._newest = self._newest, None
            fault = self._fault
        if frame is None:
            raise CameraLost(f"{self.name} {fault or 'gives no images'}; waiting for it")
        return frame

    def close(self) -> None:
        """Lets go of the camera."""
        self._closed.set()
        with self._changed:
            self._changed.notify_all()
        self._thread.join(timeout=PATIENCE)

    def _run(self, capture: cv2.VideoCapture | None) -> None:
        wait = FIRST_WAIT
        while not self._closed.is_set():
            if capture is not None:
                wait = FIRST_WAIT if self._take_images(capture) else wait
                capture.release()
            if self._closed.wait(wait):
                return
            wait = min(2.0 * wait, LONGEST_WAIT)
            capture = self._open()
        if capture is not None:
            capture.release()

    def _take_images(self, capture: cv2.VideoCapture) -> bool:
        """Until there are no more, or the source is closed; whether there were any."""
        any_taken = False
        while not self._closed.is_set():
            image = _image(capture)
            if image is None:
                self._fault = "gives no images any more (unplugged?)"
                break
            size = (image.shape[1], image.shape[0])
            if size != self.size:
                self._fault = "now has {} x {} pixels, not {} x {}".format(*size, *self.size)
                break
            self._put(image)
            any_taken = True
        return any_taken

    def _put(self, image: Image) -> None:
        frame = Frame(image, None, time.monotonic() - self._start, self.name)
        with self._changed:
            self._newest, self._fault = frame, ""
            self._changed.notify_all()


def open_device(
    device: int | str, size: tuple[int, int] | None = None, fps: float | None = None
) -> DeviceSource:
    """Opens a camera.

    Args:
        device: its number, `/dev/videoN`, or the address of a stream (rtsp, http).
        size: width and height that it shall have [pixels]; its own choice if not given.
        fps: images a second that it shall take; some cameras take the nearest that they can.

    Raises:
        InvalidInputError: it does not open, or not with that size.
    """
    source = DeviceSource(
        f"camera {device}" if isinstance(device, int) else device,
        lambda: _capture(device, size, fps),
        ON_AIR if "://" in str(device) else PLUGGED,
    )
    if size is not None and source.size != tuple(size):
        source.close()
        raise InvalidInputError(
            "{} gives {} x {} pixels instead of {} x {}; choose a size that it supports".format(
                source.name, *source.size, *size
            )
        )
    return source


def open_devices(most: int = 64) -> Iterator[tuple[str, tuple[int, int]]]:
    """Names and sizes of the cameras of this machine that give images, of the first `most`."""
    for device in _candidates(most):
        capture = _capture(device, None, None)
        image = None if capture is None else _image(capture)
        if capture is not None:
            capture.release()
        if image is not None:
            yield str(device), (image.shape[1], image.shape[0])


def _candidates(most: int) -> list[int]:
    if sys.platform.startswith("linux"):
        from pathlib import Path

        numbers = (path.name.removeprefix("video") for path in Path("/dev").glob("video*"))
        return sorted(int(number) for number in numbers if number.isdigit())[:most]
    return list(range(min(most, 4)))


def _capture(
    device: int | str, size: tuple[int, int] | None, fps: float | None
) -> cv2.VideoCapture | None:
    with quiet():
        if isinstance(device, int) or device.startswith("/dev/"):
            # Without a choice OpenCV tries all that it has.
            capture = cv2.VideoCapture(device, BACKENDS.get(sys.platform, cv2.CAP_ANY))
        else:
            capture = cv2.VideoCapture(device, cv2.CAP_FFMPEG, NETWORK)
    if not capture.isOpened():
        return None
    if size is not None:
        # Uncompressed, large images come at a few frames a second over USB.
        capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, size[0])
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, size[1])
    if fps is not None:
        capture.set(cv2.CAP_PROP_FPS, fps)
    return capture


def _image(capture: cv2.VideoCapture) -> Image | None:
    with contextlib.suppress(cv2.error):
        good, bgr = capture.read()
        if good and bgr is not None and bgr.size:
            if bgr.ndim == 2:
                bgr = cv2.cvtColor(bgr, cv2.COLOR_GRAY2BGR)
            return np.ascontiguousarray(bgr[..., ::-1])
    return None
