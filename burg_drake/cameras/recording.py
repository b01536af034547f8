"""Recordings of a live view: a video, a table of camera poses and a document."""

from __future__ import annotations

import contextlib
import csv
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TextIO

import cv2
import numpy as np

from burg_drake.cameras.image_files import silence_opencv
from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.cameras.placement.document import CheckedScene, camera_versions
from burg_drake.cameras.pose.board_estimate import BoardEstimate
from burg_drake.core import (
    Array,
    BurgError,
    Bytes,
    DocumentError,
    Indices,
    InvalidInputError,
    make_pose,
    quaternion_from_rotation,
    read_rows,
    require_writable,
    rotation_from_quaternion,
    save_document,
)

VIDEO_CODECS = {".mp4": "mp4v", ".avi": "MJPG"}
"""Codecs that OpenCV's wheels write on every platform."""


@dataclass(frozen=True)
class RecordingFiles:
    """The files of a recording, `NAME.mp4` (or .avi) and those beside it.

    Attributes:
        video: the video.
        with_plain: whether there is a video without overlay, too.
    """

    video: Path
    with_plain: bool = False

    @property
    def plain(self) -> Path:
        """`NAME_plain.mp4`, the video without overlay."""
        return self.video.with_stem(f"{self.video.stem}_plain")

    @property
    def videos(self) -> tuple[Path, ...]:
        """The videos: one or both."""
        return (self.video, self.plain) if self.with_plain else (self.video,)

    @property
    def table(self) -> Path:
        """`NAME.csv`, see `RECORDING_COLUMNS`."""
        return self.video.with_suffix(".csv")

    @property
    def document(self) -> Path:
        """`NAME.recording.yaml`, see `RecordingDocument`; `NAME.yaml` may well be the scene."""
        return self.video.with_suffix(".recording.yaml")

    @property
    def growing_files(self) -> tuple[Path, ...]:
        """The files written during the recording."""
        return (*self.videos, self.table)

    def existing(self) -> Path | None:
        """The first existing file of the recording, finished or partial; None if there is none."""
        wanted = (*self.growing_files, self.document, *map(partial_path, self.growing_files))
        return next((path for path in wanted if os.path.lexists(path)), None)


def partial_path(path: Path) -> Path:
    """Temporary path of a file while it is written; OpenCV needs the suffix for the format."""
    return path.with_name(f".{path.stem}.partial{path.suffix}")


def require_video_path(path: str | Path, *, plain: bool = False) -> Path:
    """Checks that a recording can be written.

    Args:
        path: of the video.
        plain: whether there is a video without overlay, too.

    Raises:
        InvalidInputError: the suffix is not in `VIDEO_CODECS`, a file exists, or the folder is not
            writable.
    """
    path = Path(path)
    if path.suffix.lower() not in VIDEO_CODECS:
        raise InvalidInputError(
            f"{path}: the name of a recording must end in {' or '.join(VIDEO_CODECS)}"
        )
    existing = RecordingFiles(path, plain).existing()
    if existing is not None:
        raise InvalidInputError(f"{existing} exists already; choose another name for the recording")
    require_writable(path)
    return path


RECORDING_COLUMNS = (
    *("frame", "time", "valid", "x", "y", "z", "qw", "qx", "qy", "qz"),
    *("reprojection_error", "markers", "reason"),
)
"""Columns of a recording's table."""


@dataclass(frozen=True, eq=False)
class RecordedPoses:
    """The table of a recording.

    Attributes:
        frames: (N,) first frame of the video with each picture.
        times: (N,) of the pictures [s].
        X_SC: (N, 4, 4) camera in the scene frame; NaN without a pose.
    """

    frames: Indices
    times: Array
    X_SC: Array


def table_row(frame: int, time: float, estimate: BoardEstimate) -> list[Any]:
    """Builds a row of `RECORDING_COLUMNS`.

    Args:
        frame: of the video.
        time: of the picture [s].
        estimate: of the camera's pose.
    """
    error, X_SC = estimate.reprojection_error, estimate.X_SC
    pose = [""] * 7
    if estimate.valid:
        values = (*X_SC[:3, 3], *quaternion_from_rotation(X_SC[:3, :3]))
        pose = [f"{value:.9g}" for value in values]
    return [
        frame,
        f"{time:.6f}",
        int(estimate.valid),
        *pose,
        f"{error:.6g}" if np.isfinite(error) else "",
        len(estimate.ids),
        estimate.reason,
    ]


def read_poses(path: str | Path) -> RecordedPoses:
    """Reads the table of a recording.

    Raises:
        DocumentError: the file is missing, or is not the table of a recording.
    """
    path = Path(path)
    try:
        (_, header), *lines = read_rows(path)
        rows = [dict(zip(header, cells, strict=True)) for _, cells in lines]
        poses = [_read_pose(row) for row in rows]
        numbers = [(int(row["frame"]), float(row["time"])) for row in rows]
    except DocumentError:
        raise
    except (KeyError, ValueError) as error:
        raise DocumentError(
            f"{path} is not the table of a recording; expected the columns"
            f" {', '.join(RECORDING_COLUMNS)}"
        ) from error
    return RecordedPoses(
        np.array([frame for frame, _ in numbers], dtype=np.int64),
        np.array([time for _, time in numbers], dtype=float),
        np.array(poses, dtype=float).reshape(-1, 4, 4),
    )


def _read_pose(row: dict[str, Any]) -> Array:
    if row["valid"] != "1":
        return np.full((4, 4), np.nan)
    *p, qw, qx, qy, qz = (float(row[name]) for name in RECORDING_COLUMNS[3:10])
    return make_pose(rotation_from_quaternion([qw, qx, qy, qz]), p)


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
    in real time. It contains every added picture.

    Args:
        path: of the video, .mp4 or .avi; the other `RecordingFiles` are written beside it.
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
        self._last: tuple[float, tuple[Bytes, ...]] | None = None
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
        self._stream = _open_table(files.table)
        try:
            self._table = csv.writer(self._stream, lineterminator="\n")
            self._table.writerow(RECORDING_COLUMNS)
            for video in files.videos:
                self._writers.append(_open_video(video, frames_per_second, intrinsics))
        except BaseException:
            self._discard()
            raise

    def add(
        self,
        overlay: Bytes,
        estimate: BoardEstimate,
        time: float,
        plain: Bytes,
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
            self._repeat_last_picture(time)
        try:
            self._table.writerow(table_row(self.frames, time, estimate))
            self._stream.flush()
        except OSError as error:
            raise InvalidInputError(
                f"cannot write {self._files.table}: {error.strerror}"
            ) from error
        pictures = (overlay, plain)[: len(self._writers)]
        self._last = (time, pictures)
        self._write_frame(pictures)
        self.pictures += 1

    def close(self) -> Path | None:
        """Finishes the files and gives them their names.

        Returns:
            The video; None if no picture was added, in which case no file is left.

        Raises:
            InvalidInputError: the video cannot be read back (disk full), or a file of that name was
                created meanwhile. The recording stays under its temporary names.
        """
        if self._stream.closed:
            return self.path if self.pictures else None
        if not self.pictures:
            self._discard()
            return None
        self._close_streams()
        files = self._files
        for path in files.videos:
            found = _count_frames(partial_path(path))
            if found != self.frames:
                raise InvalidInputError(
                    f"{partial_path(path)} has {found} of the {self.frames} recorded frames; is the"
                    " disk full?"
                )
        for path in (*files.growing_files, files.document):
            if os.path.lexists(path):
                raise InvalidInputError(
                    f"{path} was created while recording; the recording is kept as"
                    f" {partial_path(files.video)}"
                )
        save_document(self._document, files.document)
        for path in (files.table, *files.videos):
            os.replace(partial_path(path), path)
        return self.path

    def _close_streams(self) -> None:
        """Closes the open files."""
        for writer in self._writers:
            writer.release()
        try:
            self._stream.close()
        except OSError as error:
            raise InvalidInputError(f"cannot write {self._files.table}: {error}") from error

    def _discard(self) -> None:
        """Deletes the files of a recording without pictures."""
        with contextlib.suppress(BurgError):
            self._close_streams()
        for path in self._files.growing_files:
            partial_path(path).unlink(missing_ok=True)

    def _repeat_last_picture(self, time: float) -> None:
        """Repeats the last picture up to the time of a new one."""
        assert self._last is not None
        before, pictures = self._last
        # Seconds. Longer pauses of a lost camera are shortened in the video.
        self._clock += min(max(time - before, 0.0), 2.0)
        while self.frames < round(self.frames_per_second * self._clock):
            self._write_frame(pictures)

    def _write_frame(self, pictures: tuple[Bytes, ...]) -> None:
        for writer, picture in zip(self._writers, pictures, strict=True):
            writer.write(np.ascontiguousarray(picture[..., ::-1]))
        self.frames += 1


def _open_table(path: Path) -> TextIO:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return partial_path(path).open("x", newline="", encoding="utf-8")
    except OSError as error:
        raise InvalidInputError(
            f"cannot write {path}: {error.strerror or error}; choose a writable place"
        ) from error


def _open_video(path: Path, rate: float, intrinsics: Intrinsics) -> cv2.VideoWriter:
    size = (intrinsics.width, intrinsics.height)
    codec = cv2.VideoWriter.fourcc(*VIDEO_CODECS[path.suffix.lower()])
    with silence_opencv():
        writer = cv2.VideoWriter(str(partial_path(path)), codec, rate, size)
    if not writer.isOpened():
        raise InvalidInputError(
            f"cannot write {path}: OpenCV cannot encode {size[0]} x {size[1]} pixels at {rate:g}"
            f" frames per second as {path.suffix}"
        )
    return writer


def _count_frames(path: Path) -> int:
    with silence_opencv():
        capture = cv2.VideoCapture(str(path))
        count = int(capture.get(cv2.CAP_PROP_FRAME_COUNT)) if capture.isOpened() else 0
        capture.release()
    return count
