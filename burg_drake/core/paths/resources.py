"""Finds the data that the package installs: `models/`, `scenes/` and `stations/`.

A wheel carries them inside the package, a checkout beside it; both are found by the same
references: `package://burg_drake/models/...` or a bare name such as `panda_tabletop`. Other
packages are found by `core.paths.packages`.
"""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

from burg_drake.core.errors import InvalidInputError, UnknownNameError, nearest
from burg_drake.core.paths.packages import NO_PACKAGES, PACKAGE_REFERENCE, Packages, package_file

BURG_DRAKE = "burg_drake"
"""The package that the installed data are."""
PACKAGE_URI = f"package://{BURG_DRAKE}/"
WORDS = {"scenes": "scene", "stations": "station", "models": "library", "models/hands": "hand"}
"""What people call one of each kind."""


@cache
def data_root() -> Path:
    """Folder that holds `models/`, `scenes/` and `stations/`.

    Raises:
        InvalidInputError: the installation is incomplete.
    """
    package = Path(__file__).resolve().parents[2]
    for root in (package / "_data", package.parent):
        if (root / "models").is_dir() and (root / "scenes").is_dir():
            return root
    raise InvalidInputError(
        f"there are no folders models/ and scenes/ in {package} or next to it; reinstall burg_drake"
    )


def resolve(
    reference: str | Path,
    kind: str | None = None,
    base: Path | None = None,
    packages: Packages = NO_PACKAGES,
) -> Path:
    """Path of a document, model or library folder.

    Args:
        reference: `package://burg_drake/...`; `package://NAME/...` of another package; or, with
            `kind`, the bare name of something that the package installs; or a path, relative to
            `base` (or to the working directory).
        kind: `scenes`, `stations` or `models/hands` (bare names stand for `NAME.yaml`), or
            `models` (bare names stand for a folder).
        base: folder of the document that holds the reference.
        packages: what a document says of other packages.

    Returns:
        An existing path.

    Raises:
        UnknownNameError: nothing is there; the message lists the built-in names of this kind, or
            where the package was looked for.
        InvalidInputError: it is a pipe.
    """
    text = str(reference)
    if text.startswith(PACKAGE_URI):
        path = data_root() / text.removeprefix(PACKAGE_URI)
        if not path.exists():
            raise UnknownNameError(f"{text} does not exist in {data_root()}")
        return path
    if PACKAGE_REFERENCE.fullmatch(text):
        return package_file(text, base, packages)
    path = expanded(text)
    if kind is not None and path.name == text and not path.suffix:
        builtin = data_root() / kind / (text if kind == "models" else f"{text}.yaml")
        if os.path.exists(builtin):
            return builtin
    located = path if base is None else base / path
    if os.path.exists(located):  # also tells of names that are too long, and of links in a circle
        if located.is_fifo():  # what is named so is read more than once, and in its folder
            raise InvalidInputError(f"cannot read {text}: it is a pipe; save it to a file first")
        return located.resolve()
    where = f" (relative to {base})" if base is not None and not path.is_absolute() else ""
    known = f"; {nearest(path.stem, builtin_names(kind))}" if kind else ""
    what = f"{WORDS[kind]} " if kind and base is None else ""  # documents name the entry
    raise UnknownNameError(f"{what}{text} does not exist{where}{known}")


def expanded(text: str) -> Path:
    """A path whose leading `~` or `~user` stands for a home folder.

    Raises:
        UnknownNameError: there is no such user.
    """
    try:
        return Path(text).expanduser()
    except RuntimeError as error:
        user = Path(text).parts[0]
        raise UnknownNameError(
            f"{text}: user {user!r} has no home folder here; write the whole path"
        ) from error


def builtin_names(kind: str) -> list[str]:
    """Bare names that `resolve` knows for a kind."""
    folder = data_root() / kind
    if kind == "models":
        return sorted(p.name for p in folder.iterdir() if (p / "library.yaml").exists())
    return sorted(p.stem for p in folder.glob("*.yaml"))
