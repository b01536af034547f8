"""Names that become parts of paths: of files, of ids, and in Meshcat."""

from __future__ import annotations

import re
from collections.abc import Iterable

from burg_drake.core.errors import FieldError, quoted

LONGEST = 100
"""Of a name, in bytes of UTF-8; file systems take 255, with what is put before and behind it."""

_NAME = re.compile(r"(?!\.)[\w.-]+")
_UNSAFE = re.compile(r"[^\w.-]+")


def require_name(name: str, *place: str | int) -> None:
    """Refuses what would lead to another folder, or hide a file.

    Args:
        name: to check.
        place: of the name in its document, see `FieldError`.

    Raises:
        FieldError: it is not a name.
    """
    if not _NAME.fullmatch(name) or len(name.encode()) > LONGEST:
        raise FieldError(
            f"name {quoted(name)} cannot be used in paths; give letters, digits, '_', '-' and '.',"
            f" no '.' in front, at most {LONGEST} bytes",
            *place,
        )


def require_names(names: Iterable[str], key: str) -> None:
    """The same of all keys of a mapping that a document has under `key`."""
    for name in names:
        require_name(name, key, name)


def name_from(text: str) -> str:
    """A name made of any text: `my scene (2)` becomes `my_scene_2`, and nothing `unnamed`."""
    name = _UNSAFE.sub("_", text).lstrip(".").strip("_")
    return name.encode()[:LONGEST].decode(errors="ignore") or "unnamed"
