"""Recordings of the live view: a video, a table with the camera's pose in every frame, and a
document that says of what.

All is written beside its place under hidden names, and renamed when the recording is closed. No
file that exists is ever replaced.
"""

from __future__ import annotations

import contextlib
import csv
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.live.recording_files import (
    CODECS,
    RecordingFiles,
    partial,
    require_video_path,
)
from burg_drake.cameras.live.recording_table import COLUMNS, table_row
from burg_drake.cameras.optics import Intrinsics
from burg_drake.cameras.placement import CheckedScene, camera_versions
from burg_drake.cameras.pose import BoardEstimate
from burg_drake.cameras.sources import quiet
from burg_drake.core import BurgError, InvalidInputError
from burg_drake.core.documents import save_document

LONGEST_PAUSE = 2.0
"""Longer ones, of a camera that was away, are shortened to this in the video [s]."""


@dataclass(frozen=True, kw_only=True)
class RecordingDocument:
    """A recorded video of the live overlay.

    Attributes:
        scene: the scene that was overlaid.
        source: camera or file that gave the pictures.
        started: date and time of the start, ISO 8601 with time zone.
        video: file of the video.
        plain: file of the video without overlay, if there is one.
        poses: table of the camera's pose in each picture alone (CSV): time [s], pose (metres,
            quaternion), reprojection error [pixels], number of markers, and why there is no pose.
        frames_per_second: frame rate of the video [1/s].
        intrinsics: intrinsics of the camera.
        versions: versions of the software.
    """

    version: int = 1
    scene: CheckedScene
    source: str
    started: str = ""
    video: str
    plain: str = ""
    poses: str
    frames_per_second: float
    intrinsics: Intrinsics
    versions: dict[str, str] = field(default_factory=camera_versions)


class Recording:
    """Writes a recording, frame by frame, until it is closed.

    The video has a fixed rate: a picture is repeated until the next one was taken, so that it plays
    as fast as things happened. Every picture that is added is in it.

    Args:
        path: of the video, .mp4 or .avi; the others of `RecordingFiles` are written beside it.
        intrinsics: of the camera; they give the size of the video.
        scene, source, started: see `RecordingDocument`.
        frames_per_second: of the video.
        plain: also write `NAME_plain`, the pictures without overlay.

    Raises:
        InvalidInputError: another suffix, a file exists, or the place cannot be written.
    """

    def __init__(
        self,
        path: str | Path,
        intrinsics: Intrinsics,
        scene: CheckedScene,
        *,
        source: str = "",
        started: str = "",
        frames_per_second: float = 30.0,
        plain: bool = False,
    ) -> None:
        self.path = require_video_path(path, plain=plain)
        self.frames = 0
        """Frames of the video so far."""
        self.pictures = 0
        """Pictures that were added."""
        self.frames_per_second = frames_per_second
        self._clock = 0.0
        self._last: tuple[float, tuple[NDArray[np.uint8], ...]] | None = None
        self._files = files = RecordingFiles(self.path, plain)
        self._document = RecordingDocument(
            scene=scene,
            source=source,
            started=started,
            video=files.video.name,
            plain=files.plain.name if plain else "",
            poses=files.table.name,
            frames_per_second=frames_per_second,
            intrinsics=intrinsics,
        )
        self._writers: list[cv2.VideoWriter] = []
        self._stream = _new_table(files.table)
        try:
            self._table = csv.writer(self._stream, lineterminator="\n")
            self._table.writerow(COLUMNS)
            for video in files.videos:
                self._writers.append(_writer(video, frames_per_second, intrinsics))
        except BaseException:
            self._abandon()
            raise

    def add(
        self,
        overlay: NDArray[np.uint8],
        estimate: BoardEstimate,
        time: float,
        plain: NDArray[np.uint8],
    ) -> None:
        """Adds a picture.

        Args:
            overlay: (H, W, 3) RGB, with the overlay.
            estimate: of the camera's pose.
            time: when the picture was taken, on any clock [s].
            plain: (H, W, 3) RGB, as the camera gave it.

        Raises:
            InvalidInputError: the table cannot be written (disk full).
        """
        if self._last is not None:
            self._fill(time)
        try:
            self._table.writerow(table_row(self.frames, time, estimate))
            self._stream.flush()
        except OSError as error:
            raise InvalidInputError(
                f"cannot write {self._files.table}: {error.strerror}"
            ) from error
        pictures = (overlay, plain)[: len(self._writers)]
        self._last = (time, pictures)
        self._write(pictures)
        self.pictures += 1

    def close(self) -> Path | None:
        """Finishes the files and gives them their names.

        Returns:
            The video; None if no picture was added, and then no file is left.

        Raises:
            InvalidInputError: what was written cannot be read back (disk full), or a file of one of
                the names was made meanwhile. What was recorded is left under its hidden names.
        """
        if self._stream.closed:
            return self.path if self.pictures else None
        if not self.pictures:
            self._abandon()
            return None
        self._release()
        files = self._files
        for path in files.videos:
            found = _frames_in(partial(path))
            if found != self.frames:
                raise InvalidInputError(
                    f"{partial(path)} has {found} of the {self.frames} recorded frames; is the"
                    " disk full?"
                )
        for path in (*files.growing, files.document):
            if os.path.lexists(path):
                raise InvalidInputError(
                    f"{path} was created while recording; the recording is kept as"
                    f" {partial(files.video)}"
                )
        save_document(self._document, files.document)
        for path in (files.table, *files.videos):
            os.replace(partial(path), path)
        return self.path

    def _release(self) -> None:
        """Closes what is open."""
        for writer in self._writers:
            writer.release()
        try:
            self._stream.close()
        except OSError as error:
            raise InvalidInputError(f"cannot write {self._files.table}: {error}") from error

    def _abandon(self) -> None:
        """Leaves nothing of a recording without pictures."""
        with contextlib.suppress(BurgError):
            self._release()
        for path in self._files.growing:
            partial(path).unlink(missing_ok=True)

    def _fill(self, time: float) -> None:
        """Repeats the last picture until a new one was taken."""
        assert self._last is not None
        before, pictures = self._last
        self._clock += min(max(time - before, 0.0), LONGEST_PAUSE)
        while self.frames < round(self.frames_per_second * self._clock):
            self._write(pictures)

    def _write(self, pictures: tuple[NDArray[np.uint8], ...]) -> None:
        for writer, picture in zip(self._writers, pictures, strict=True):
            writer.write(np.ascontiguousarray(picture[..., ::-1]))
        self.frames += 1


def _new_table(path: Path) -> TextIO:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return partial(path).open("x", newline="", encoding="utf-8")
    except OSError as error:
        raise InvalidInputError(
            f"cannot write {path}: {error.strerror or error}; choose a writable place"
        ) from error


def _writer(path: Path, rate: float, intrinsics: Intrinsics) -> cv2.VideoWriter:
    size = (intrinsics.width, intrinsics.height)
    codec = cv2.VideoWriter.fourcc(*CODECS[path.suffix.lower()])
    with quiet():
        writer = cv2.VideoWriter(str(partial(path)), codec, rate, size)
    if not writer.isOpened():
        raise InvalidInputError(
            f"cannot write {path}: OpenCV cannot encode {size[0]} x {size[1]} pixels at {rate:g}"
            f" frames per second as {path.suffix}"
        )
    return writer


def _frames_in(path: Path) -> int:
    with quiet():
        capture = cv2.VideoCapture(str(path))
        count = int(capture.get(cv2.CAP_PROP_FRAME_COUNT)) if capture.isOpened() else 0
        capture.release()
    return count
