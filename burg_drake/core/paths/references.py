"""How files refer to other files and folders: never by an absolute path, as that would tell of the
machine that wrote it, and be wrong on any other one."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from burg_drake.core.errors import UnknownNameError
from burg_drake.core.paths.resources import PACKAGE_URI, builtin_names, data_root, resolve

SHIPPED = ("models", "scenes", "stations")
"""Folders that the package installs."""

KEYS = frozenset({"scene", "library", "station", "run", "document", "file"})
"""Keys of a provenance, wherever in it, whose values are paths."""


def portable_reference(path: Path, folder: Path) -> str:
    """How a document in `folder` refers to a file or folder: package:// for what the package
    ships, else the relative path."""
    path = path.resolve()
    for name in SHIPPED:
        shipped = data_root() / name
        if path.is_relative_to(shipped):
            return f"{PACKAGE_URI}{name}/{path.relative_to(shipped).as_posix()}"
    return os.path.relpath(path, folder.resolve())


def shareable_reference(path: Path, folder: Path) -> str:
    """The same, for a document that may go elsewhere and does not depend on what it refers to.

    Of a path that shares no folder with `folder`, but for those above people's homes, only the end
    is told: the name, with that of its folder if that is nobody's home.
    """
    reference, path, home = portable_reference(path, folder), path.resolve(), Path.home()
    shared = Path(os.path.commonpath([path, folder.resolve()]))
    if reference.startswith(PACKAGE_URI) or shared not in home.parents:
        return reference
    private = path.parent.parent in home.parents
    return path.name if private else f"{path.parent.name}/{path.name}"


def with_shareable_references(values: Any, folder: Path) -> Any:
    """JSON values whose absolute paths, under `KEYS`, are those of `shareable_reference`."""
    return _changed(
        values,
        lambda text: shareable_reference(Path(text), folder) if os.path.isabs(text) else text,
    )


def with_resolved_references(values: Any, folder: Path) -> Any:
    """The same values with absolute paths in place of references to what is there; others stay.

    Args:
        values: of a document in `folder`.
        folder: the folder.
    """
    return _changed(values, lambda text: _found(text, folder))


def is_resolved(reference: str, *kinds: str) -> bool:
    """Whether `with_resolved_references` has found something, or it is built in; what it has not
    is relative to a folder that the file has left, not to the working directory.

    Args:
        reference: from a provenance.
        kinds: of what may be built in, as `resources.builtin_names` has them.
    """
    if os.path.isabs(reference) or reference.startswith(PACKAGE_URI):
        return True
    return any(reference in builtin_names(kind) for kind in kinds)


def _found(text: str, folder: Path) -> str:
    try:
        return str(resolve(text, base=folder.resolve())) if text else text
    except (UnknownNameError, OSError, ValueError, RuntimeError):
        return text


def _changed(values: Any, change: Any) -> Any:
    if isinstance(values, Mapping):
        return {
            key: change(value)
            if key in KEYS and isinstance(value, str)
            else _changed(value, change)
            for key, value in values.items()
        }
    if isinstance(values, list):
        return [_changed(value, change) for value in values]
    return values
