"""What verbs share that write scene files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from burg_drake.core import InvalidInputError

if TYPE_CHECKING:
    from burg_drake.objects.library import ObjectLibrary
    from burg_drake.station.document import Station


def require_another_file(scene: Path, output: str) -> None:
    """Refuses to write over the scene that is read.

    Raises:
        InvalidInputError: the files are one.
    """
    if os.path.realpath(output) == os.path.realpath(scene):
        raise InvalidInputError(f"-o {output} is the scene itself; choose another file")


def library_reference(given: str, library: ObjectLibrary, folder: Path) -> str:
    """How a scene file in `folder` refers to a library so that it is found from there: the name of
    a built-in one, else package:// or the relative path."""
    from burg_drake.core.paths import builtin_names, portable_reference

    return given if given in builtin_names("models") else portable_reference(library.root, folder)


def station_reference(given: str, station: Station, folder: Path) -> str:
    """The same for a station."""
    from burg_drake.core.paths import builtin_names, portable_reference

    return given if given in builtin_names("stations") else portable_reference(station.path, folder)
