"""The file of a session's scene: it is written only while it is as the session knows it."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

from burg_drake.core import BurgError, InvalidInputError
from burg_drake.core.documents import document_text
from burg_drake.core.files import atomic_write
from burg_drake.core.paths import builtin_names, portable_reference, require_name
from burg_drake.objects.library import ObjectLibrary, load_library
from burg_drake.scene.document import SceneDocument


class FileChanged(InvalidInputError):
    """A file is not as the session left it; writing it would lose what somebody else wrote."""


class UnsavedChanges(InvalidInputError):
    """Going on would lose changes that are not in any file."""


def fingerprint(path: Path) -> str | None:
    """A hash of what a file holds; None if it is not there.

    Raises:
        InvalidInputError: it is there and cannot be read.
    """
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise InvalidInputError(f"cannot read {path}: {error.strerror or error}") from error


def scene_path(name: str, folder: Path) -> Path:
    """The file of a scene by its name, in a folder and nowhere else.

    Args:
        name: `breakfast` or `breakfast.yaml`.
        folder: that was opened.

    Raises:
        FieldError: it is not a name: it would lead elsewhere, or hide the file.
        InvalidInputError: there is a link of that name, which leads elsewhere.
    """
    stem = name.removesuffix(".yaml").removesuffix(".yml")
    require_name(stem)
    path = folder / f"{stem}.yaml"
    if path.is_symlink() and not path.resolve().is_relative_to(folder.resolve()):
        raise InvalidInputError(f"{path} is a link to another folder; choose another name")
    return path


def write_scene(
    document: SceneDocument, library: ObjectLibrary, path: Path, *, known: str | None, force: bool
) -> tuple[SceneDocument, str]:
    """Writes a scene file so that its library is found from there.

    Args:
        document: the scene.
        library: its library.
        path: the file.
        known: `fingerprint` that the file should have.
        force: writes it all the same.

    Returns:
        The document as it was written, and the file's fingerprint.

    Raises:
        FileChanged: the file has another fingerprint.
        InvalidInputError: it cannot be written; then it is as it was.
    """
    found = fingerprint(path)
    if found not in (known, None) and not force:
        what = "exists already" if known is None else "was changed by another program"
        raise FileChanged(
            f"{path} {what}; overwrite it, save under another name, or load it to see what it holds"
        )
    written = replace(document, library=library_reference(document, library, path.parent))
    text = document_text(written)
    atomic_write(path, text)
    return written, hashlib.sha256(text.encode()).hexdigest()


def library_reference(document: SceneDocument, library: ObjectLibrary, folder: Path) -> str:
    """How a scene file in `folder` refers to its library: as the document does if that leads there,
    else by package:// or the relative path."""
    if document.library in builtin_names("models"):
        return document.library
    try:
        if load_library(document.library, folder).root.resolve() == library.root.resolve():
            return document.library
    except (BurgError, OSError):
        pass
    return portable_reference(library.root, folder)
