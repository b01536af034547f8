"""Recordings of the live view: a video, a table with the camera's pose in every frame, and a
document that says of what.

All is written beside its place under hidden names, and renamed when the recording is closed.
"""

from __future__ import annotations

import csv
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TextIO

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.board_estimate import BoardEstimate
from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.cameras.placement_document import CheckedScene, software_versions
from burg_drake.core.errors import DocumentError, InvalidInputError
from burg_drake.core.files import require_writable
from burg_drake.core.frames import Array, make_pose, quaternion_from_rotation
from burg_drake.core.frames import rotation_from_quaternion as from_quaternion
from burg_drake.core.schema import save_document

CODECS = {".mp4": "mp4v", ".avi": "MJPG"}
"""What OpenCV's wheels can write on every platform, without a system's encoder. Of an .avi that was
cut off (power failure) players still show what there is; an .mp4 is whole or unreadable."""
LONGEST_PAUSE = 2.0
"""Longer ones, of a camera that was away, are shortened to this in the video [s]."""
COLUMNS = (
    *("frame", "time", "valid", "x", "y", "z", "qw", "qx", "qy", "qz"),
    *("reprojection_error", "markers", "reason"),
)


@dataclass(frozen=True, kw_only=True)
class RecordingDocument:
    """Schema of the document of a recording.

    Attributes:
        scene: that was overlaid.
        source: what gave the pictures.
        started: date and time, ISO 8601 with time zone.
        video: file name of the video.
        plain: file name of the video without overlay, if there is one.
        poses: file name of the table: `frame` of the video, `time` of the picture [s], the camera's
            pose X_SC where it is valid (metres, quaternion), reprojection error [pixels], number
            of markers, and why there is no pose.
        frames_per_second: of the video.
        intrinsics: of the camera.
        versions: of the software.
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
    versions: dict[str, str] = field(default_factory=software_versions)


@dataclass(frozen=True, eq=False)
class RecordedPoses:
    """The table of a recording.

    Attributes:
        frames: (N,) the frame of the video that first shows it.
        times: (N,) of the pictures [s].
        X_SC: (N, 4, 4) camera in the scene frame; NaN where there was no pose.
    """

    frames: NDArray[np.int64]
    times: Array
    X_SC: Array


class Recording:
    """Writes a recording, frame by frame, until it is closed.

    The video has a fixed rate: a picture is repeated until the next one was taken, so that it plays
    as fast as things happened. Every picture that is added is in it.

    Args:
        path: of the video, .mp4 or .avi; `NAME.csv` and `NAME.yaml` are written beside it.
        intrinsics: of the camera; they give the size of the video.
        scene, source, started: see `RecordingDocument`.
        frames_per_second: of the video.
        plain: also write `NAME_plain`, the pictures without overlay.

    Raises:
        InvalidInputError: another suffix, or the place cannot be written.
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
        self.path = require_video_path(path)
        self.frames = 0
        """Frames of the video so far."""
        self.pictures = 0
        """Pictures that were added."""
        self.frames_per_second = frames_per_second
        self._clock = 0.0
        self._last: tuple[float, NDArray[np.uint8], NDArray[np.uint8]] | None = None
        self._plain_path = self.path.with_stem(f"{self.path.stem}_plain") if plain else None
        self._table_path = self.path.with_suffix(".csv")
        self._document = RecordingDocument(
            scene=scene,
            source=source,
            started=started,
            video=self.path.name,
            plain=self._plain_path.name if self._plain_path else "",
            poses=self._table_path.name,
            frames_per_second=frames_per_second,
            intrinsics=intrinsics,
        )
        self.path.parent.mkdir(parents=True, exist_ok=True)
        size = (intrinsics.width, intrinsics.height)
        self._video = _writer(self.path, frames_per_second, size)
        self._plain = _writer(self._plain_path, frames_per_second, size) if plain else None
        self._stream: TextIO = _partial(self._table_path).open("w", newline="", encoding="utf-8")
        self._table = csv.writer(self._stream, lineterminator="\n")
        self._table.writerow(COLUMNS)

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
        row = [self.frames, f"{time:.6f}", int(estimate.valid), *_pose_columns(estimate)]
        error = estimate.reprojection_error
        row += [f"{error:.6g}" if np.isfinite(error) else "", len(estimate.ids), estimate.reason]
        try:
            self._table.writerow(row)
            self._stream.flush()
        except OSError as failure:
            raise InvalidInputError(
                f"cannot write {self._table_path}: {failure.strerror}"
            ) from failure
        self._last = (time, overlay, plain)
        self._write(overlay, plain)
        self.pictures += 1

    def close(self) -> Path | None:
        """Finishes the files and gives them their names.

        Returns:
            The video; None if no picture was added, and then no file is left.

        Raises:
            InvalidInputError: what was written cannot be read back (disk full).
        """
        if self._stream.closed:
            return self.path if self.pictures else None
        for writer in (self._video, self._plain):
            if writer is not None:
                writer.release()
        try:
            self._stream.close()
        except OSError as failure:
            raise InvalidInputError(f"cannot write {self._table_path}: {failure}") from failure
        videos = [path for path in (self.path, self._plain_path) if path is not None]
        if not self.pictures:
            for path in (*videos, self._table_path):
                _partial(path).unlink(missing_ok=True)
            return None
        for path in videos:
            found = _frames_in(_partial(path))
            if found != self.frames:
                raise InvalidInputError(
                    f"{_partial(path)} has {found} frames of the {self.frames} that were recorded;"
                    " is the disk full?"
                )
        save_document(self._document, self.path.with_suffix(".yaml"))
        for path in (self._table_path, *videos):
            os.replace(_partial(path), path)
        return self.path

    def _fill(self, time: float) -> None:
        """Repeats the last picture until a new one was taken."""
        assert self._last is not None
        before, overlay, plain = self._last
        self._clock += min(max(time - before, 0.0), LONGEST_PAUSE)
        while self.frames < round(self.frames_per_second * self._clock):
            self._write(overlay, plain)

    def _write(self, overlay: NDArray[np.uint8], plain: NDArray[np.uint8]) -> None:
        self._video.write(np.ascontiguousarray(overlay[..., ::-1]))
        if self._plain is not None:
            self._plain.write(np.ascontiguousarray(plain[..., ::-1]))
        self.frames += 1


def require_video_path(path: str | Path) -> Path:
    """Finds out whether a video can be recorded there.

    Raises:
        InvalidInputError: another suffix than those of `CODECS`, or no writable place.
    """
    path = Path(path)
    if path.suffix.lower() not in CODECS:
        raise InvalidInputError(f"{path}: a recording is {' or '.join(CODECS)}")
    require_writable(path)
    return path


def read_poses(path: str | Path) -> RecordedPoses:
    """Reads the table of a recording.

    Raises:
        DocumentError: the file is missing, or is none.
    """
    path = Path(path)
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            rows = list(csv.DictReader(stream))
        poses = [_pose(row) for row in rows]
        numbers = [(int(row["frame"]), float(row["time"])) for row in rows]
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise DocumentError(
            f"{path} is not the table of a recording: {type(error).__name__} {error}"
        ) from error
    return RecordedPoses(
        np.array([frame for frame, _ in numbers], dtype=np.int64),
        np.array([time for _, time in numbers], dtype=float),
        np.array(poses, dtype=float).reshape(-1, 4, 4),
    )


def _pose_columns(estimate: BoardEstimate) -> list[str]:
    if not estimate.valid:
        return [""] * 7
    X_SC = estimate.X_SC
    values = (*X_SC[:3, 3], *quaternion_from_rotation(X_SC[:3, :3]))
    return [f"{value:.9g}" for value in values]


def _pose(row: dict[str, Any]) -> Array:
    if row["valid"] != "1":
        return np.full((4, 4), np.nan)
    p, q = ([float(row[name]) for name in names] for names in (COLUMNS[3:6], COLUMNS[6:10]))
    return make_pose(from_quaternion(q), p)


def _partial(path: Path) -> Path:
    """Where a file is written first; the suffix stays, which tells OpenCV the format."""
    return path.with_name(f".{path.stem}.partial{path.suffix}")


def _writer(path: Path | None, rate: float, size: tuple[int, int]) -> cv2.VideoWriter:
    assert path is not None
    codec = cv2.VideoWriter.fourcc(*CODECS[path.suffix.lower()])
    writer = cv2.VideoWriter(str(_partial(path)), codec, rate, size)
    if not writer.isOpened():
        raise InvalidInputError(f"cannot write {path}: OpenCV has no encoder for {path.suffix}")
    return writer


def _frames_in(path: Path) -> int:
    capture = cv2.VideoCapture(str(path))
    count = int(capture.get(cv2.CAP_PROP_FRAME_COUNT)) if capture.isOpened() else 0
    capture.release()
    return count
