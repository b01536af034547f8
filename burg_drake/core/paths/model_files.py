"""The files that a model's SDF or URDF names, and the packages that it names them by."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from burg_drake.core.errors import UnknownNameError
from burg_drake.core.files import DOCUMENT, read_bytes
from burg_drake.core.paths.packages import PACKAGE_REFERENCE, Packages
from burg_drake.core.paths.resources import BURG_DRAKE, resolve

FILE_REFERENCE = re.compile(r"""<uri>\s*([^<]+?)\s*</uri>|filename=["']([^"']+)["']""")
"""A mesh or a model in SDF, or in URDF."""
MARKS = (b"package://", b"model://", b"<include")
"""One of them is in a model that names packages, or another model."""
MODELS = (".sdf", ".urdf")
"""Suffixes of files that name others."""
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)


def named_files(model: Path, packages: Packages) -> list[Path]:
    """The files that a model names, and those that the models that it includes name, as far as they
    are there.

    Args:
        model: an SDF or URDF file.
        packages: where packages are looked for.
    """
    return [file for file in dict.fromkeys(_named(model, packages, {model})) if file.is_file()]


def named_packages(model: Path, packages: Packages) -> dict[str, Path]:
    """Folders by name of the packages that a model and those that it includes name.

    Raises:
        UnknownNameError: one of them is nowhere; the message names the file and what was searched.
    """
    if not may_name_packages(model):
        return {}  # as most, of which some name many files
    found: dict[str, Path] = {}
    for file in (model, *(f for f in named_files(model, packages) if f.suffix in MODELS)):
        for reference in _references(file):
            parts = PACKAGE_REFERENCE.fullmatch(reference)
            if parts is None or parts[1] in (*found, BURG_DRAKE):
                continue
            try:
                found[parts[1]] = packages.find(parts[1], file.parent)
            except UnknownNameError as error:
                raise UnknownNameError(f"{file} refers to {reference}: {error}") from error
    return found


def may_name_packages(model: Path) -> bool:
    """Whether a model may name files of packages, or other models."""
    text = read_bytes(model, DOCUMENT.size)
    return any(mark in text for mark in MARKS)


def _named(model: Path, packages: Packages, seen: set[Path]) -> Iterator[Path]:
    """The files that are named, each followed by those that it names itself."""
    for reference in _references(model):
        try:
            path = resolve(reference, base=model.parent, packages=packages)
        except UnknownNameError:
            continue
        # An included model may be named by its folder, in which a model.config names its files.
        inside = sorted(file for file in path.glob("*") if file.suffix in (".config", ".sdf"))
        for file in inside if path.is_dir() else [path]:
            yield file
            if file.suffix in MODELS and file not in seen:
                seen.add(file)
                yield from _named(file, packages, seen)


def _references(model: Path) -> list[str]:
    """What stands for files in a model, each once."""
    text = _COMMENT.sub("", read_bytes(model, DOCUMENT.size).decode(errors="replace"))
    return list(dict.fromkeys(uri or name for uri, name in FILE_REFERENCE.findall(text)))
