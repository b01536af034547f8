"""Photographs as a source of frames."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from burg_drake.cameras.sources.frame import Frame, FrameSource
from burg_drake.cameras.sources.image_file import SUFFIXES, read_image
from burg_drake.core import InvalidInputError


class ImageSource(FrameSource):
    """Image files, one after the other.

    Args:
        paths: of the files.
        name: of the source; the file's, or the first's and how many there are, if not given.

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
        first_error = None
        for path in self._paths:
            try:
                height, width = read_image(path).shape[:2]
            except InvalidInputError as error:
                first_error = first_error or error
            else:
                return width, height
        assert first_error is not None
        raise first_error


def images_in(folder: Path) -> list[Path]:
    """Image files of a folder, `view9.png` before `view10.png`.

    Raises:
        InvalidInputError: there are none.
    """
    found = [path for path in folder.iterdir() if is_image(path)]
    if not found:
        raise InvalidInputError(f"folder {folder} has no images ({', '.join(SUFFIXES)})")
    return in_order(found)


def is_image(path: Path) -> bool:
    """An image by its name; hidden files are not."""
    return path.suffix.lower() in SUFFIXES and not path.name.startswith(".")


def in_order(paths: Sequence[Path]) -> list[Path]:
    """Paths by name, numbers in them by value."""

    def key(path: Path) -> list[tuple[int, str]]:
        parts = re.split(r"(\d+)", str(path))
        return [(int(part), "") if part.isdigit() else (0, part) for part in parts]

    return sorted(paths, key=key)
