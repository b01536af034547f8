"""Finds the folders of packages, which `package://NAME/...` and `model://NAME/...` are relative to,
where ROS and Drake find them, without either of the two.

Looked at, the first that has the package wins: what a document states; the `package.xml` of the
folder of the file with the reference and of all above it, and of folders NAME beside those;
`ROS_PACKAGE_PATH`; `AMENT_PREFIX_PATH`; for `drake` and `drake_models` the installed Drake and what
it has downloaded before. Nothing is downloaded.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from burg_drake.core.errors import InvalidInputError, UnknownNameError, did_you_mean
from burg_drake.core.files import DOCUMENT, read_bytes

PACKAGE_REFERENCE = re.compile(r"(?:package|model)://([^/]*)/*(.*)", re.DOTALL)
"""Drake takes the two for the same."""
MANIFEST = "package.xml"
IGNORED = ("AMENT_IGNORE", "CATKIN_IGNORE", "COLCON_IGNORE")
"""Files that keep ROS, and Drake, out of a folder."""
ROS_1, ROS_2 = "ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"
DRAKE, DRAKE_MODELS = "drake", "drake_models"

_NAME = re.compile(r"<name>\s*([^<]*?)\s*</name>")
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)


@dataclass(frozen=True, eq=False)
class Packages:
    """Where packages are looked for.

    Attributes:
        stated: folders by the names of packages, as a document states them.
        document: that document, for messages; None where there is none.
        key: of it that states them.
    """

    stated: Mapping[str, Path] = field(default_factory=dict)
    document: Path | None = None
    key: str = "packages"

    def find(self, name: str, near: Path | None = None) -> Path:
        """The folder of a package.

        Args:
            name: of the package.
            near: folder of the file that names it; the working directory if None.

        Raises:
            UnknownNameError: it is nowhere; the message tells what was searched.
        """
        if name in self.stated:
            return self.stated[name]
        near = (near or Path()).resolve()
        for folder in _candidates(name, near):
            return folder
        raise UnknownNameError(self._not_found(name, near))

    def _not_found(self, name: str, near: Path) -> str:
        places = [f"{near} and the folders above it"]
        for variable in (ROS_1, ROS_2):
            paths = _paths(variable)
            places.append(f"{variable} ({':'.join(map(str, paths)) if paths else 'not set'})")
        if name == DRAKE_MODELS:
            cached = drake_models_folder()
            places.append(f"Drake's cache ({cached})" if cached else "the installed Drake")
        meant = did_you_mean(name, self.stated)
        stating = f"add the folder that it is in to {ROS_1}"
        if self.document is not None:
            stating = f"name its folder by {self.key}: {{{name}: FOLDER}} in {self.document}"
        fetching = (
            "; or let Drake download it once, with PackageMap().GetPath('drake_models')"
            if name == DRAKE_MODELS
            else ""
        )
        return (
            f"package {name!r} is not found in {', '.join(places)};"
            f"{f' {meant} If not,' if meant else ''} {stating}{fetching}"
        )


NO_PACKAGES = Packages()
"""Where no document states any."""


def package_file(reference: str, near: Path | None, packages: Packages) -> Path:
    """The file or folder of `package://NAME/...`, which exists.

    Raises:
        UnknownNameError: there is no such package, or nothing of that name in it.
    """
    parts = PACKAGE_REFERENCE.fullmatch(reference)
    if parts is None or not parts[1]:
        raise UnknownNameError(f"{reference} has no package name; write package://NAME/FILE")
    try:
        folder = packages.find(parts[1], near)
    except UnknownNameError as error:
        raise UnknownNameError(f"{reference}: {error}") from error
    path = folder / parts[2]
    if not os.path.exists(path):
        raise UnknownNameError(f"{reference} does not exist: {parts[1]!r} is {folder}")
    return path


def drake_models_folder() -> Path | None:
    """Where the installed Drake keeps its `drake_models` once it has downloaded them, whether it
    has or not; None without Drake. As in its `package_map.cc` and `find_cache.cc`."""
    share = _drake_share()
    if share is None:
        return None
    try:
        manifest = json.loads(
            read_bytes(share / "multibody/parsing/drake_models.json", DOCUMENT.size)
        )
        prefix = hashlib.sha256(manifest["strip_prefix"].encode()).hexdigest()
        folder = f"{manifest['sha256']}-{prefix}"
    except (InvalidInputError, ValueError, KeyError, TypeError, AttributeError):
        return None
    if "TEST_TMPDIR" in os.environ:
        cache = Path(os.environ["TEST_TMPDIR"]) / ".cache"
    elif "XDG_CACHE_HOME" in os.environ:
        cache = Path(os.environ["XDG_CACHE_HOME"])
    else:
        cache = Path(os.path.expanduser("~")) / ".cache"
    return cache / "drake/package_map" / folder


def _candidates(name: str, near: Path) -> Iterator[Path]:
    """Folders of a package, the one to take first."""
    for folder in (near, *near.parents):
        for place in (folder, folder / name):
            if _manifest_name(place) == name:
                yield place
    for path in _paths(ROS_1):
        yield from _crawled(name, path, set())
    for path in _paths(ROS_2):
        if os.path.isdir(path / "share" / name):
            yield path / "share" / name
    own = {DRAKE: _drake_share, DRAKE_MODELS: drake_models_folder}.get(name, lambda: None)()
    if own is not None and own.is_dir():
        yield own


def _crawled(name: str, folder: Path, seen: set[str]) -> Iterator[Path]:
    """Packages of a name in a folder and in those in it; there are none in packages and in hidden
    folders."""
    real = os.path.realpath(folder)
    if real in seen or any(os.path.exists(folder / mark) for mark in IGNORED):
        return
    seen.add(real)
    if os.path.exists(folder / MANIFEST):
        if _manifest_name(folder) == name:
            yield folder
        return
    try:
        inner = sorted(entry.name for entry in os.scandir(folder) if entry.is_dir())
    except OSError:
        return
    for part in inner:
        if not part.startswith("."):
            yield from _crawled(name, folder / part, seen)


def _manifest_name(folder: Path) -> str:
    """The name of the package whose manifest is in a folder; empty if none is."""
    manifest = folder / MANIFEST
    if not os.path.isfile(manifest):
        return ""
    try:
        text = read_bytes(manifest, DOCUMENT.size).decode(errors="replace")
    except InvalidInputError:
        return ""
    found = _NAME.search(_COMMENT.sub("", text))
    return found[1] if found else ""


def _paths(variable: str) -> list[Path]:
    """The folders in an environment variable."""
    return [Path(part) for part in os.environ.get(variable, "").split(os.pathsep) if part]


def _drake_share() -> Path | None:
    """The resources of the installed Drake, found without importing it."""
    found = importlib.util.find_spec("pydrake")
    share = Path(found.origin).parent / "share/drake" if found and found.origin else None
    return share if share is not None and share.is_dir() else None
