"""Which files a recording consists of, and whether they can be made."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from burg_drake.core import InvalidInputError
from burg_drake.core.files import require_writable

CODECS = {".mp4": "mp4v", ".avi": "MJPG"}
"""What OpenCV's wheels can write on every platform, without a system's encoder. Of an .avi that was
cut off (power failure) players still show what there is; an .mp4 is whole or unreadable."""


@dataclass(frozen=True)
class RecordingFiles:
    """The files of a recording, `NAME.mp4` (or .avi) and those beside it.

    Attributes:
        video: the video.
        with_plain: there is a video without overlay, too.
    """

    video: Path
    with_plain: bool = False

    @property
    def plain(self) -> Path:
        """`NAME_plain.mp4`, the video without overlay."""
        return self.video.with_stem(f"{self.video.stem}_plain")

    @property
    def videos(self) -> tuple[Path, ...]:
        """One or both."""
        return (self.video, self.plain) if self.with_plain else (self.video,)

    @property
    def table(self) -> Path:
        """`NAME.csv`, see `recording_table`."""
        return self.video.with_suffix(".csv")

    @property
    def document(self) -> Path:
        """`NAME.recording.yaml`, see `RecordingDocument`; `NAME.yaml` may well be the scene."""
        return self.video.with_suffix(".recording.yaml")

    @property
    def growing(self) -> tuple[Path, ...]:
        """What is written while the recording goes on."""
        return (*self.videos, self.table)

    def existing(self) -> Path | None:
        """The first of them that exists, finished or not; None if there is none."""
        wanted = (*self.growing, self.document, *map(partial, self.growing))
        return next((path for path in wanted if os.path.lexists(path)), None)

    def require_free(self) -> None:
        """
        Raises:
            InvalidInputError: one of the files exists.
        """
        existing = self.existing()
        if existing is not None:
            raise InvalidInputError(
                f"{existing} exists already; choose another name for the recording"
            )


def partial(path: Path) -> Path:
    """Where a file is written first; the suffix stays, which tells OpenCV the format."""
    return path.with_name(f".{path.stem}.partial{path.suffix}")


def require_video_path(path: str | Path, *, plain: bool = False) -> Path:
    """Finds out whether a recording can be made there.

    Args:
        path: of the video.
        plain: there will be one without overlay, too.

    Raises:
        InvalidInputError: another suffix than those of `CODECS`, a file exists that the recording
            would replace, or no writable place.
    """
    path = Path(path)
    if path.suffix.lower() not in CODECS:
        raise InvalidInputError(
            f"{path}: the name of a recording must end in {' or '.join(CODECS)}"
        )
    RecordingFiles(path, plain).require_free()
    require_writable(path)
    return path
