"""What OpenCV writes to the terminal by itself."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

import cv2

SILENT = 0
"""OpenCV's `LOG_LEVEL_SILENT`, which OpenCV 4 has no name for in Python."""


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Keeps OpenCV and FFmpeg from writing to the terminal what becomes an error of ours."""
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # read when FFmpeg is first used
    log = getattr(cv2.utils, "logging", cv2)  # OpenCV 5; in OpenCV 4 they are in cv2 itself
    level = log.getLogLevel()
    log.setLogLevel(SILENT)
    try:
        yield
    finally:
        log.setLogLevel(level)
