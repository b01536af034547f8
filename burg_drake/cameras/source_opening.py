"""Open a source of frames by name: a photo, video, camera, network stream or simulated camera."""

from __future__ import annotations

import contextlib
import glob
import re
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from burg_drake.cameras.frame_source import CameraLost, Frame, FrameSource, Image
from burg_drake.cameras.image_files import IMAGE_SUFFIXES, read_image, silence_opencv
from burg_drake.cameras.intrinsics_file import SIMULATED_PREFIX, find_simulated_camera
from burg_drake.core import InvalidInputError, expand_home
from burg_drake.scene import Scene, SceneLike, as_scene


def open_source(
    reference: str | Path | int | Sequence[str | Path],
    *,
    scene: SceneLike | None = None,
    size: tuple[int, int] | None = None,
    fps: float | None = None,
) -> FrameSource:
    """Opens a source of frames.

    Args:
        reference: source to open:
            `0`, `1`, ... or `/dev/video0`: a camera of this machine;
            `rtsp://...`, `http://...`: a stream from the network;
            `sim:STATION[/CAMERA]`: a simulated camera of a station that looks at `scene`;
            an image file, a folder of them, or a pattern such as `photos/*.jpg`;
            any other file: a video.
            A list of image files, folders and patterns is one sequence.
        scene: seen by a simulated camera.
        size: requested width and height for a camera of this machine [pixels].
        fps: requested frames per second of a local or simulated camera.

    Raises:
        InvalidInputError: the source does not exist or cannot be read.
        UnknownNameError: no such station, or it has no such camera.
        MissingDependencyError: a simulated camera without the renderer's system libraries.
    """
    scene = None if scene is None else as_scene(scene)
    if not isinstance(reference, (str, Path, int)):
        if len(reference) != 1:
            return _open_images([str(item) for item in reference])
        (reference,) = reference
    text = str(reference).strip()
    if text.startswith(SIMULATED_PREFIX):
        return _open_simulated(text, scene, fps)
    # URLs that OpenCV opens as network streams.
    streams = ("rtsp://", "rtsps://", "rtmp://", "http://", "https://", "udp://", "tcp://")
    if text.isdecimal() or text.startswith(("/dev/video", *streams)):
        return open_device(int(text) if text.isdecimal() else text, size, fps)
    if not text:
        raise InvalidInputError(
            "the camera is an empty text; give 0, a file, a folder or sim:STATION"
        )

    path = expand_home(text)
    if path.is_file() and not is_image(path):
        return VideoSource(path)
    return _open_images([text])


def _open_simulated(reference: str, scene: Scene | None, fps: float | None) -> FrameSource:
    from burg_drake.cameras.simulated_source import SIMULATED_FPS, SimulatedSource

    station, camera = find_simulated_camera(reference)
    if scene is None:
        raise InvalidInputError(f"{reference} is a simulated camera, which needs a scene; give one")
    return SimulatedSource(scene, station, camera, fps=fps or SIMULATED_FPS)


def _open_images(references: Sequence[str]) -> FrameSource:
    return ImageSource(image_paths(references), references[0] if len(references) == 1 else "")


def image_paths(references: Sequence[str]) -> list[Path]:
    """Finds image files by names, folders or patterns such as `photos/*.jpg`.

    Raises:
        InvalidInputError: there are none.
    """
    paths: list[Path] = []
    for reference in references:
        path = expand_home(reference)
        if path.is_dir():
            paths += images_in(path)
        elif path.exists():
            paths.append(path)
        elif glob.has_magic(reference):
            found = [Path(name) for name in glob.glob(str(path), recursive=True)]
            images = [name for name in found if is_image(name)]
            if not images:
                raise InvalidInputError(f"no image files match {reference!r}")
            paths += sort_naturally(images)
        else:
            raise InvalidInputError(
                f"{reference} does not exist; give an image or video file, a folder or pattern of"
                " images, the number of a camera, an rtsp or http address, or"
                f" {SIMULATED_PREFIX}STATION/CAMERA"
            )
    return paths


class ImageSource(FrameSource):
    """Image files, one after the other.

    Args:
        paths: of the files.
        name: of the source; by default the name of the first file, and the number of the others.

    Raises:
        InvalidInputError: there are no files, or none can be read.
    """

    def __init__(self, paths: Sequence[str | Path], name: str = "") -> None:
        self._paths = [Path(path) for path in paths]
        if not self._paths:
            raise InvalidInputError("no image files are given")
        others = len(self._paths) - 1
        self.name = name or f"{self._paths[0]}" + (f" and {others} others" if others else "")
        self.live = False
        self.size = self._first_size()
        self._next = 0

    def __len__(self) -> int:
        return len(self._paths)

    def read(self) -> Frame | None:
        """See `FrameSource.read`."""
        if self._next >= len(self._paths):
            return None
        number, path = self._next, self._paths[self._next]
        self._next += 1
        return Frame(read_image(path), None, float(number), path.name)

    def close(self) -> None:
        """No more frames."""
        self._next = len(self._paths)

    def _first_size(self) -> tuple[int, int]:
        errors = []
        for path in self._paths:
            try:
                height, width = read_image(path).shape[:2]
                return width, height
            except InvalidInputError as error:
                errors.append(error)
        raise errors[0]


def images_in(folder: Path) -> list[Path]:
    """Lists the image files of a folder, `view9.png` before `view10.png`.

    Raises:
        InvalidInputError: there are none.
    """
    found = [path for path in folder.iterdir() if is_image(path)]
    if not found:
        raise InvalidInputError(f"folder {folder} has no images ({', '.join(IMAGE_SUFFIXES)})")
    return sort_naturally(found)


def is_image(path: Path) -> bool:
    """Whether a path names an image; hidden files do not count."""
    return path.suffix.lower() in IMAGE_SUFFIXES and not path.name.startswith(".")


def sort_naturally(paths: Sequence[Path]) -> list[Path]:
    """Sorts paths by name, with numbers in them by value."""

    def key(path: Path) -> list[tuple[int, str]]:
        parts = re.split(r"(\d+)", str(path))
        return [(int(part), "") if part.isdigit() else (0, part) for part in parts]

    return sorted(paths, key=key)


DEFAULT_VIDEO_FPS = 30.0
"""Frames per second of files that do not state them."""


class VideoSource(FrameSource):
    """A video file, frame by frame; as for photographs, orientation metadata are ignored.

    Args:
        path: of the file.

    Attributes:
        broken: number of unreadable frames that were skipped so far.

    Raises:
        InvalidInputError: it cannot be read as a video.
    """

    def __init__(self, path: str | Path) -> None:
        path = Path(path)
        if not path.is_file():
            raise InvalidInputError(f"video or image {path} does not exist")
        with silence_opencv():
            self._capture = cv2.VideoCapture(str(path), cv2.CAP_ANY)
            self._capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
        self.name, self.live = path.name, False
        self.broken = 0
        self._taken = 0
        self.fps = self._capture.get(cv2.CAP_PROP_FPS) or DEFAULT_VIDEO_FPS
        self._count = int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT))
        self._first_image = self._next_image() if self._capture.isOpened() else None
        if self._first_image is None:
            raise InvalidInputError(f"{path} is empty, or cannot be read as a video or image")
        self.size = (self._first_image.shape[1], self._first_image.shape[0])

    def __len__(self) -> int:
        """Number of frames stated by the file."""
        return self._count

    def read(self) -> Frame | None:
        """See `FrameSource.read`."""
        image, self._first_image = self._first_image, None
        if image is None:
            image = self._next_image()
        if image is None:
            return None
        number = self._taken - 1
        return Frame(
            image, None, number / (self.fps or DEFAULT_VIDEO_FPS), f"{self.name}, frame {number}"
        )

    def close(self) -> None:
        """Closes the file."""
        self._first_image = None
        self._capture.release()

    def _next_image(self) -> Image | None:
        """Reads the next readable frame; None at the end."""
        for _ in range(100):  # Consecutive unreadable frames after which the file ends.
            image = _read_rgb(self._capture)
            if image is not None:
                self._taken += 1
                return image
            if self._taken + 1 >= self._count:
                return None
            self._taken += 1
            self.broken += 1
        return None


FRAME_TIMEOUT = 2.0
"""Seconds without an image after which a camera counts as lost."""
MIN_REOPEN_INTERVAL = 0.5  # Seconds until a lost camera is opened again; doubled each time ...
MAX_REOPEN_INTERVAL = 5.0  # ... up to this.

CAMERA_HINT = (
    "is it plugged in, is no other program using it, and do you have permission to read it?"
    " `burg-drake camera list` shows which cameras open"
)
"""What to check if a camera does not open."""
STREAM_HINT = "is the address right, is it reachable on the network, and does it send video?"
"""What to check if a stream does not open."""

CAPTURE_BACKENDS = {"linux": cv2.CAP_V4L2, "darwin": cv2.CAP_AVFOUNDATION}
"""OpenCV's backend for local cameras on each platform."""


class DeviceSource(FrameSource):
    """A camera that OpenCV opens.

    Args:
        name: name in messages.
        open_capture: opens the camera, again after a loss; returns None on failure.
        hint: text on what to check if the camera does not open.

    Raises:
        InvalidInputError: it does not open, or gives no images.
    """

    def __init__(
        self,
        name: str,
        open_capture: Callable[[], cv2.VideoCapture | None],
        hint: str = CAMERA_HINT,
    ) -> None:
        self.name, self.live = name, True
        self._open = open_capture
        self._start = time.monotonic()
        capture = open_capture()
        first = None if capture is None else _read_rgb(capture)
        if capture is None or first is None:
            what = "does not open" if capture is None else "opens, but gives no images"
            raise InvalidInputError(f"{name} {what}; {hint}")
        self.size = (first.shape[1], first.shape[0])
        self.fps = capture.get(cv2.CAP_PROP_FPS) or None
        self._changed = threading.Condition()
        self._newest: Frame | None = None
        self._closed = threading.Event()
        self._fault = ""
        self._store_image(first)
        self._thread = threading.Thread(target=self._run, args=(capture,), daemon=True)
        self._thread.start()

    def read(self) -> Frame | None:
        """See `FrameSource.read`."""
        with self._changed:
            self._changed.wait_for(lambda: self._newest or self._closed.is_set(), FRAME_TIMEOUT)
            if self._closed.is_set():
                return None
            frame, self._newest = self._newest, None
            fault = self._fault
        if frame is None:
            raise CameraLost(f"{self.name} {fault or 'gives no images'}; waiting for it")
        return frame

    def close(self) -> None:
        """Releases the camera."""
        self._closed.set()
        with self._changed:
            self._changed.notify_all()
        self._thread.join(timeout=FRAME_TIMEOUT)

    def _run(self, capture: cv2.VideoCapture | None) -> None:
        interval = MIN_REOPEN_INTERVAL
        while not self._closed.is_set():
            if capture is not None:
                interval = MIN_REOPEN_INTERVAL if self._take_images(capture) else interval
                capture.release()
            if self._closed.wait(interval):
                return
            interval = min(2.0 * interval, MAX_REOPEN_INTERVAL)
            capture = self._open()
        if capture is not None:
            capture.release()

    def _take_images(self, capture: cv2.VideoCapture) -> bool:
        """Takes images until there are no more or the source is closed; returns whether there were
        any.
        """
        any_taken = False
        while not self._closed.is_set():
            image = _read_rgb(capture)
            if image is None:
                self._fault = "gives no images any more (unplugged?)"
                break
            size = (image.shape[1], image.shape[0])
            if size != self.size:
                self._fault = "now has {} x {} pixels, not {} x {}".format(*size, *self.size)
                break
            self._store_image(image)
            any_taken = True
        return any_taken

    def _store_image(self, image: Image) -> None:
        frame = Frame(image, None, time.monotonic() - self._start, self.name)
        with self._changed:
            self._newest, self._fault = frame, ""
            self._changed.notify_all()


def open_device(
    device: int | str, size: tuple[int, int] | None = None, fps: float | None = None
) -> DeviceSource:
    """Opens a camera.

    Args:
        device: number of the camera, `/dev/videoN`, or the address of a stream (rtsp, http).
        size: requested width and height [pixels]; the camera's default if not given.
        fps: requested frames per second; some cameras take the nearest supported rate.

    Raises:
        InvalidInputError: it does not open, or not with that size.
    """
    source = DeviceSource(
        f"camera {device}" if isinstance(device, int) else device,
        lambda: _open_capture(device, size, fps),
        STREAM_HINT if "://" in str(device) else CAMERA_HINT,
    )
    if size is not None and source.size != tuple(size):
        source.close()
        raise InvalidInputError(
            "{} gives {} x {} pixels instead of {} x {}; choose a size that it supports".format(
                source.name, *source.size, *size
            )
        )
    return source


def open_devices() -> Iterator[tuple[str, tuple[int, int]]]:
    """Names and sizes of the working cameras of this machine."""
    for device in _candidate_devices():
        capture = _open_capture(device, None, None)
        image = None if capture is None else _read_rgb(capture)
        if capture is not None:
            capture.release()
        if image is not None:
            yield str(device), (image.shape[1], image.shape[0])


def _candidate_devices() -> list[int]:
    """Numbers of at most 64 cameras to try; without a list of the system, 0 to 3."""
    if sys.platform.startswith("linux"):
        numbers = (path.name.removeprefix("video") for path in Path("/dev").glob("video*"))
        return sorted(int(number) for number in numbers if number.isdigit())[:64]
    return [0, 1, 2, 3]


def _open_capture(
    device: int | str, size: tuple[int, int] | None, fps: float | None
) -> cv2.VideoCapture | None:
    # OpenCV would wait for half a minute.
    stream_timeouts = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, 5000, cv2.CAP_PROP_READ_TIMEOUT_MSEC, 5000]
    with silence_opencv():
        if isinstance(device, int) or device.startswith("/dev/"):
            # Without a choice OpenCV tries all its backends.
            capture = cv2.VideoCapture(device, CAPTURE_BACKENDS.get(sys.platform, cv2.CAP_ANY))
        else:
            capture = cv2.VideoCapture(device, cv2.CAP_FFMPEG, stream_timeouts)
    if not capture.isOpened():
        return None
    if size is not None:
        # Large uncompressed images reach only a few frames per second over USB.
        capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, size[0])
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, size[1])
    if fps is not None:
        capture.set(cv2.CAP_PROP_FPS, fps)
    return capture


def _read_rgb(capture: cv2.VideoCapture) -> Image | None:
    with contextlib.suppress(cv2.error):
        good, bgr = capture.read()
        if good and bgr is not None and bgr.size:
            if bgr.ndim == 2:
                bgr = cv2.cvtColor(bgr, cv2.COLOR_GRAY2BGR)
            return np.ascontiguousarray(bgr[..., ::-1])
    return None
