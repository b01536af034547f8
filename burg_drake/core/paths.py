"""Installed data, packages of models, and the names and references by which files refer to files.

`package://NAME/...` and `model://NAME/...` are looked up where ROS and Drake find packages, without
importing either of them. References in documents are never absolute paths: these would reveal the
machine that wrote them, and be wrong on any other.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from burg_drake.core.errors import (
    FieldError,
    InvalidInputError,
    UnknownNameError,
    did_you_mean,
    quote_value,
    suggest_names,
)
from burg_drake.core.files import FileLimits, read_bytes

MESH_FILE = "mesh.obj"


MAX_NAME_BYTES = 100
"""UTF-8 bytes of a name. File systems allow 255 with prefix and suffix."""


def require_name(name: str, *place: str | int) -> None:
    """Rejects names that would lead to another folder, or hide a file.

    Args:
        name: the name.
        place: place of the name in its document, see `FieldError`.

    Raises:
        FieldError: the name is invalid.
    """
    if not re.fullmatch(r"(?!\.)[\w.-]+", name) or len(name.encode()) > MAX_NAME_BYTES:
        raise FieldError(
            f"name {quote_value(name)} cannot be used in paths; give letters, digits, '_', '-' and"
            f" '.', no '.' in front, at most {MAX_NAME_BYTES} bytes",
            *place,
        )


def require_names(names: Iterable[str], key: str) -> None:
    """As `require_name`, for all keys of the mapping under `key` in a document."""
    for name in names:
        require_name(name, key, name)


def make_name(text: str) -> str:
    """Converts any text to a name: `my scene (2)` to `my_scene_2`, and empty text to `unnamed`."""
    name = re.sub(r"[^\w.-]+", "_", text).lstrip(".").strip("_")
    return name.encode()[:MAX_NAME_BYTES].decode(errors="ignore") or "unnamed"


def unused_name(wanted: str, taken: Collection[str]) -> str:
    """`wanted`, with the first number that makes it unique if it is taken: mug, mug_2, mug_3."""
    name, number = wanted, 1
    while name in taken:
        number += 1
        name = f"{wanted}_{number}"
    return name


PACKAGE_REFERENCE = re.compile(r"(?:package|model)://([^/]*)/*(.*)", re.DOTALL)
"""Drake treats both schemes alike."""


@dataclass(frozen=True, eq=False)
class Packages:
    """Search for ROS packages.

    Attributes:
        stated: package folders by name that a document states.
        document: the document, for messages; None if there is none.
        key: key of the folders in the document.
    """

    stated: Mapping[str, Path] = field(default_factory=dict)
    document: Path | None = None
    key: str = "packages"

    def find(self, name: str, near: Path | None = None) -> Path:
        """Finds the folder of a package.

        Args:
            name: name of the package.
            near: folder of the file that names it; the working directory if None.

        Raises:
            UnknownNameError: it is not found; the message lists the searched places.
        """
        if name in self.stated:
            return self.stated[name]
        near = (near or Path()).resolve()
        for folder in _package_folders(name, near):
            return folder
        raise UnknownNameError(self._not_found_message(name, near))

    def _not_found_message(self, name: str, near: Path) -> str:
        places = [f"{near} and the folders above it"]
        for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
            paths = _folders_in_variable(variable)
            places.append(f"{variable} ({':'.join(map(str, paths)) if paths else 'not set'})")
        if name == "drake_models":
            cached = drake_models_folder()
            places.append(f"Drake's cache ({cached})" if cached else "the installed Drake")
        meant = did_you_mean(name, self.stated)
        advice = "add the folder that it is in to ROS_PACKAGE_PATH"
        if self.document is not None:
            advice = f"name its folder by {self.key}: {{{name}: FOLDER}} in {self.document}"
        if name == "drake_models":
            advice += "; or let Drake download it once, with PackageMap().GetPath('drake_models')"
        return (
            f"package {name!r} is not found in {', '.join(places)};"
            f"{f' {meant} If not,' if meant else ''} {advice}"
        )


NO_PACKAGES = Packages()
"""Packages for files without a document that gives package folders."""


def package_file(reference: str, near: Path | None, packages: Packages) -> Path:
    """The existing file or folder of `package://NAME/...`.

    Raises:
        UnknownNameError: there is no such package, or no such file in it.
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
    """Folder of the installed Drake for its downloaded `drake_models`, which may not exist yet;
    None without Drake. As in its `package_map.cc` and `find_cache.cc`."""
    share = _drake_share_folder()
    if share is None:
        return None
    try:
        manifest = json.loads(
            read_bytes(share / "multibody/parsing/drake_models.json", FileLimits.document.size)
        )
        prefix = hashlib.sha256(manifest["strip_prefix"].encode()).hexdigest()
        folder = f"{manifest['sha256']}-{prefix}"
    except (InvalidInputError, ValueError, KeyError, TypeError, AttributeError):
        return None
    cache = Path(os.environ.get("XDG_CACHE_HOME", os.path.expanduser("~/.cache")))
    if "TEST_TMPDIR" in os.environ:
        cache = Path(os.environ["TEST_TMPDIR"], ".cache")
    return cache / "drake/package_map" / folder


def _package_folders(name: str, near: Path) -> Iterator[Path]:
    """Candidate folders of a package, the best first."""
    for folder in (near, *near.parents):
        for place in (folder, folder / name):
            if _manifest_name(place) == name:
                yield place
    for path in _folders_in_variable("ROS_PACKAGE_PATH"):
        yield from _search_tree(name, path, set())
    for path in _folders_in_variable("AMENT_PREFIX_PATH"):
        if os.path.isdir(path / "share" / name):
            yield path / "share" / name
    find_folder = {"drake": _drake_share_folder, "drake_models": drake_models_folder}.get(name)
    of_drake = find_folder() if find_folder is not None else None
    if of_drake is not None and of_drake.is_dir():
        yield of_drake


def _search_tree(name: str, folder: Path, seen: set[str]) -> Iterator[Path]:
    """Folders of packages with a name in a folder tree; skips the inside of packages, and hidden
    folders."""
    marks = ("AMENT_IGNORE", "CATKIN_IGNORE", "COLCON_IGNORE")  # skipped by ROS and Drake
    real = os.path.realpath(folder)
    if real in seen or any(os.path.exists(folder / mark) for mark in marks):
        return
    seen.add(real)
    if os.path.exists(folder / "package.xml"):
        if _manifest_name(folder) == name:
            yield folder
        return
    try:
        inner = sorted(entry.name for entry in os.scandir(folder) if entry.is_dir())
    except OSError:
        return
    for part in inner:
        if not part.startswith("."):
            yield from _search_tree(name, folder / part, seen)


def _manifest_name(folder: Path) -> str:
    """The package name in a folder's manifest; empty without a manifest."""
    manifest = folder / "package.xml"
    if not os.path.isfile(manifest):
        return ""
    try:
        found = re.search(r"<name>\s*([^<]*?)\s*</name>", _read_without_comments(manifest))
    except InvalidInputError:
        return ""
    return found[1] if found else ""


def _read_without_comments(file: Path) -> str:
    text = read_bytes(file, FileLimits.document.size).decode(errors="replace")
    return re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)


def _folders_in_variable(variable: str) -> list[Path]:
    """The folders in an environment variable."""
    return [Path(part) for part in os.environ.get(variable, "").split(os.pathsep) if part]


def _drake_share_folder() -> Path | None:
    """The resources of the installed Drake, found without importing it."""
    found = importlib.util.find_spec("pydrake")
    share = Path(found.origin).parent / "share/drake" if found and found.origin else None
    return share if share is not None and share.is_dir() else None


PACKAGE_URI = "package://burg_drake/"  # References to installed data begin with this.


@cache
def data_root() -> Path:
    """Folder with `models/`, `scenes/` and `stations/`.

    Raises:
        InvalidInputError: the installation is incomplete.
    """
    package = Path(__file__).resolve().parents[1]
    for root in (package / "_data", package.parent):
        if (root / "models").is_dir() and (root / "scenes").is_dir():
            return root
    raise InvalidInputError(
        f"there are no folders models/ and scenes/ in {package} or next to it; reinstall burg_drake"
    )


def resolve_reference(
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
        kind: `scenes`, `scenes/suites`, `stations` or `models/hands` (bare names stand for
            `NAME.yaml`), or `models` (bare names stand for a folder).
        base: folder of the document with the reference.
        packages: package folders of the document.

    Returns:
        An existing path.

    Raises:
        UnknownNameError: the path does not exist; the message lists the built-in names of this
            kind, or the searched places.
        InvalidInputError: it is a pipe.
    """
    nouns = {
        "scenes": "scene",
        "scenes/suites": "suite",
        "stations": "station",
        "models": "library",
        "models/hands": "hand",
    }
    text = str(reference)
    if text.startswith(PACKAGE_URI):
        path = data_root() / text.removeprefix(PACKAGE_URI)
        if not path.exists():
            raise UnknownNameError(f"{text} does not exist in {data_root()}")
        return path
    if PACKAGE_REFERENCE.fullmatch(text):
        return package_file(text, base, packages)
    path = expand_home(text)
    if kind is not None and path.name == text and not path.suffix:
        builtin = data_root() / kind / (text if kind == "models" else f"{text}.yaml")
        if os.path.exists(builtin):
            return builtin
    located = path if base is None else base / path
    if os.path.exists(located):  # also fails for names that are too long, and for circular links
        if located.is_fifo():  # documents are read more than once, and need a folder
            raise InvalidInputError(f"cannot read {text}: it is a pipe; save it to a file first")
        return located.resolve()
    where = f" (relative to {base})" if base is not None and not path.is_absolute() else ""
    known = f"; {suggest_names(path.stem, builtin_names(kind))}" if kind else ""
    what = f"{nouns[kind]} " if kind and base is None else ""  # documents name the key
    raise UnknownNameError(f"{what}{text} does not exist{where}{known}")


def expand_home(text: str) -> Path:
    """A path with a leading `~` or `~user` replaced by the home folder.

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
    """Bare names that `resolve_reference` accepts for a kind."""
    folder = data_root() / kind
    if kind == "models":
        return sorted(p.name for p in folder.iterdir() if (p / "library.yaml").exists())
    return sorted(p.stem for p in folder.glob("*.yaml"))


def portable_reference(path: Path, folder: Path) -> str:
    """Reference to a file or folder for a document in `folder`: package:// for files of the
    package, else the relative path."""
    path = path.resolve()
    for name in ("models", "scenes", "stations"):  # installed with the package
        shipped = data_root() / name
        if path.is_relative_to(shipped):
            return f"{PACKAGE_URI}{name}/{path.relative_to(shipped).as_posix()}"
    return os.path.relpath(path, folder.resolve())


def name_or_reference(given: str | Path, kind: str, path: Path, folder: Path) -> str:
    """Reference for a document in `folder`: the given name if it is built in, else
    `portable_reference`.

    Args:
        given: name or path that a user has given.
        kind: kind of built-in names, see `builtin_names`.
        path: the file or folder that was found.
        folder: folder of the document.
    """
    return str(given) if str(given) in builtin_names(kind) else portable_reference(path, folder)


def shareable_reference(path: Path, folder: Path) -> str:
    """As `portable_reference`, for a document that may be moved and does not need the file.

    If a path shares no folder with `folder`, except those above home folders, only its end is
    given: the name, and the name of its folder unless that is a home folder.
    """
    reference, path, home = portable_reference(path, folder), path.resolve(), Path.home()
    shared = Path(os.path.commonpath([path, folder.resolve()]))
    if reference.startswith(PACKAGE_URI) or shared not in home.parents:
        return reference
    private = path.parent.parent in home.parents
    return path.name if private else f"{path.parent.name}/{path.name}"


def with_shareable_references(values: Any, folder: Path) -> Any:
    """JSON values of a provenance, with absolute paths replaced by `shareable_reference`."""

    def change(text: str) -> str:
        return shareable_reference(Path(text), folder) if os.path.isabs(text) else text

    return _map_paths(values, change)


def with_resolved_references(values: Any, folder: Path) -> Any:
    """JSON values with references to existing files replaced by absolute paths.

    Args:
        values: values of a document in `folder`.
        folder: the folder.
    """

    def change(text: str) -> str:
        try:
            return str(resolve_reference(text, base=folder.resolve())) if text else text
        except (UnknownNameError, OSError, ValueError, RuntimeError):
            return text

    return _map_paths(values, change)


def is_resolved(reference: str, *kinds: str) -> bool:
    """Whether a reference from `with_resolved_references` is an existing file, or built in. Others
    are relative to the file's former folder, not to the working directory.

    Args:
        reference: reference from a provenance.
        kinds: kinds of built-in names, see `builtin_names`.
    """
    if os.path.isabs(reference) or reference.startswith(PACKAGE_URI):
        return True
    return any(reference in builtin_names(kind) for kind in kinds)


def _map_paths(values: Any, change: Any) -> Any:
    path_keys = ("scene", "library", "station", "run", "document", "file")
    if isinstance(values, list):
        return [_map_paths(value, change) for value in values]
    if not isinstance(values, Mapping):
        return values
    changed = {}
    for key, value in values.items():
        is_path = key in path_keys and isinstance(value, str)
        changed[key] = change(value) if is_path else _map_paths(value, change)
    return changed


def referenced_files(model: Path, packages: Packages) -> list[Path]:
    """The existing files that a model and its included models name.

    Args:
        model: an SDF or URDF file.
        packages: where packages are looked for.
    """
    found = dict.fromkeys(_walk_references(model, packages, {model}))
    return [file for file in found if file.is_file()]


def referenced_packages(model: Path, packages: Packages) -> dict[str, Path]:
    """Folders of the packages that a model and its included models name, by package name.

    Raises:
        InvalidInputError: the model is xacro.
        UnknownNameError: a package is not found; the message names the file and the searched
            places.
    """
    _require_expanded(model)
    if not may_reference_packages(model):
        return {}  # most models; some name many files
    found: dict[str, Path] = {}
    named = [f for f in referenced_files(model, packages) if f.suffix in (".sdf", ".urdf")]
    for file in (model, *named):
        for reference in _read_references(file):
            parts = PACKAGE_REFERENCE.fullmatch(reference)
            if parts is None or parts[1] in (*found, "burg_drake"):
                continue
            try:
                found[parts[1]] = packages.find(parts[1], file.parent)
            except UnknownNameError as error:
                raise UnknownNameError(f"{file} refers to {reference}: {error}") from error
    return found


XACRO_MARK = re.compile(rb"<(xacro:\w+)|=\s*[\"'][^\"'<>]*(\$[({][^\"'<>)}]*[)}]?)")
"""Elements and values of attributes that xacro replaces when it makes a URDF."""
XML_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)


def _require_expanded(model: Path) -> None:
    """Rejects a URDF that still has to be expanded by xacro."""
    text = read_bytes(model, FileLimits.document.size)
    if b"<xacro:" not in text and b"$" not in text:
        return  # nearly all models
    text = XML_COMMENT.sub(lambda comment: b"\n" * comment[0].count(b"\n"), text)
    if found := XACRO_MARK.search(text):
        line = text.count(b"\n", 0, found.start()) + 1
        name = model.name.removesuffix(".xacro").removesuffix(".urdf")
        target = f"{name}.urdf" if model.suffix == ".xacro" else f"{name}_expanded.urdf"
        what = (found[1] or found[2]).decode(errors="replace")
        raise InvalidInputError(
            f"{model}:{line}: {what!r} is xacro, not URDF; expand the file first, and"
            f" name the new one: xacro {model.name} > {target}"
        )


def may_reference_packages(model: Path) -> bool:
    """Whether a model may refer to files of packages, or to other models."""
    text = read_bytes(model, FileLimits.document.size)
    return any(mark in text for mark in (b"package://", b"model://", b"<include"))


def _walk_references(model: Path, packages: Packages, seen: set[Path]) -> Iterator[Path]:
    """Yields the named files, each followed by the files that it names."""
    for reference in _read_references(model):
        try:
            path = resolve_reference(reference, base=model.parent, packages=packages)
        except UnknownNameError:
            continue
        # An included model may be given by its folder, with a model.config that names its files.
        inside = sorted(file for file in path.glob("*") if file.suffix in (".config", ".sdf"))
        for file in inside if path.is_dir() else [path]:
            yield file
            if file.suffix in (".sdf", ".urdf") and file not in seen:
                seen.add(file)
                yield from _walk_references(file, packages, seen)


def _read_references(model: Path) -> list[str]:
    """The distinct file references in a model."""
    pattern = r"""<uri>\s*([^<]+?)\s*</uri>|filename=["']([^"']+)["']"""
    found = re.findall(pattern, _read_without_comments(model))
    return list(dict.fromkeys(uri or name for uri, name in found))
