"""Which files of a folder are scenes."""

from __future__ import annotations

import re
from pathlib import Path

MAX_FILES = 500
"""Files that are looked into."""
HEAD_BYTES = 4096
"""Bytes of a file in which a scene names its library."""
_LIBRARY = re.compile(rb"^library:", re.MULTILINE)


def scene_names(folder: Path) -> tuple[str, ...]:
    """Names of the scene files of a folder, without their suffix, in alphabetical order.

    Args:
        folder: that was opened; what is in it may be unreadable, and is left out then.
    """
    found = []
    try:
        files = sorted(folder.glob("*.yaml"))
    except OSError:
        return ()
    for path in files[:MAX_FILES]:
        try:
            with path.open("rb") as file:
                if _LIBRARY.search(file.read(HEAD_BYTES)):
                    found.append(path.stem)
        except OSError:
            continue
    return tuple(found)
