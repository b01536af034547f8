"""Scene, station and all files that Drake reads of them as one zip, which any machine can unpack.

The same content gives the same bytes: names are sorted, times and permissions fixed. It holds the
objects that the scene uses, the models of hand and arm, and the packages that any of them names.
Who unpacks it builds the same world, to the bit of every file, or refuses it.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from burg_drake.core import InvalidInputError
from burg_drake.core.documents import dump_document, load_document
from burg_drake.core.files import open_regular
from burg_drake.core.paths import MANIFEST, NO_PACKAGES, Packages, named_files, named_packages
from burg_drake.objects.library import (
    LIBRARY_FILE,
    load_library,
    package_manifest,
)
from burg_drake.objects.meshes import companions
from burg_drake.scene.document import Scene, SceneDocument
from burg_drake.station.document import Hand, Station, StationDocument, world_content

PLACES, SCENE, STATION, HAND = "places.json", "scene.yaml", "station.yaml", "hand.yaml"
LIBRARY_TOP, HAND_TOP, ARM_TOP = "library.d", "hand.d", "arm.d"
"""Folders in a bundle; a package has one of its own name, and no package has a name with a dot."""
LONG_AGO = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True)
class Bundle:
    """A packed world.

    Attributes:
        name: SHA-256 of `data`.
        data: a zip.
        content: `world_content` of scene and station.
        scene_content, station_content: their own, to say which of them differs.
    """

    name: str
    data: bytes
    content: str
    scene_content: str
    station_content: str


def make_bundle(scene: Scene, station: Station, *, looks: bool = False) -> Bundle:
    """Packs a scene and a station.

    Args:
        scene, station: the two.
        looks: with materials and textures, for images; no grasp depends on them.

    Raises:
        MeshError: a texture is too large.
        InvalidInputError: a file cannot be read.
        UnknownNameError: a model names a package that is nowhere.
    """
    used = {i.object: None for i in (*scene.instances.values(), *scene.background.values())}
    entries = {name: scene.library.entry(name) for name in used}
    root = Path(os.path.abspath(scene.library.root))
    own = [root / file for entry in entries.values() for file in entry.files]
    models = [root / entry.sdf for entry in entries.values()]
    packages = station.packages
    library = _BundleTree.of(LIBRARY_TOP, root, models, own, packages)
    hand = _BundleTree.of(HAND_TOP, station.hand_model, [station.hand_model], [], packages)
    trees = [library, hand]
    if station.arm_model is not None:
        trees.append(_BundleTree.of(ARM_TOP, station.arm_model, [station.arm_model], [], packages))
    if looks:
        trees = [tree.with_looks() for tree in trees]
    folders = {name: folder for tree in trees for name, folder in tree.packages.items()}
    places = {
        "library": library.anchor,
        "hand_model": hand.anchor,
        "arm_model": trees[2].anchor if station.arm_model is not None else None,
        "packages": sorted(folders),
    }
    contents = {f"{n}/{MANIFEST}": _manifest(n, folder) for n, folder in folders.items()}
    contents |= {name: _bytes(path) for tree in trees for name, path in tree.files.items()}
    objects = replace(scene.library.document, objects=entries)
    contents |= {
        PLACES: json.dumps(places, indent=1).encode(),
        SCENE: dump_document(replace(scene.document, origin=None, library="")).encode(),
        STATION: dump_document(replace(station.document, packages={})).encode(),
        HAND: dump_document(station.hand).encode(),
        f"{library.anchor}/{LIBRARY_FILE}": dump_document(objects).encode(),
    }
    data = _zipped(contents)
    return Bundle(
        name=hashlib.sha256(data).hexdigest(),
        data=data,
        content=world_content(scene, station),
        scene_content=scene.content,
        station_content=station.content,
    )


def load_bundle(folder: Path) -> tuple[Scene, Station]:
    """Scene and station of a bundle that was unpacked into a folder."""
    places = json.loads((folder / PLACES).read_text())
    library = load_library(str(folder / places["library"] / LIBRARY_FILE))
    scene = Scene(load_document(folder / SCENE, SceneDocument), library, folder / SCENE)
    packages = Packages({name: folder / name for name in places["packages"]})
    arm = places["arm_model"]
    station = Station(
        load_document(folder / STATION, StationDocument),
        load_document(folder / HAND, Hand),
        folder / places["hand_model"],
        None if arm is None else folder / arm,
        folder / STATION,
        folder / HAND,
        packages,
    )
    return scene, station


def require_content(bundle: Bundle, scene: Scene, station: Station) -> None:
    """Refuses a world that is not the one that was packed.

    Args:
        bundle: its hashes; the data are not needed.
        scene, station: unpacked.

    Raises:
        InvalidInputError: they differ; the message says which.
    """
    for kind, there, here in (
        ("scene", bundle.scene_content, scene.content),
        ("station", bundle.station_content, station.content),
        ("files of the objects", bundle.content, world_content(scene, station)),
    ):
        if there != here:
            raise InvalidInputError(
                f"the {kind} of {scene.name!r} on {station.name!r} changed on the way to"
                f" a worker: content {there[:12]} was sent, {here[:12]} arrived; either a"
                " model names files by a path that exists only here (a link to another"
                " folder or an absolute path), or the worker has another release of"
                " burg_drake"
            )


@dataclass(frozen=True)
class _BundleTree:
    """Files whose relative places to each other are kept.

    Attributes:
        anchor: name in the bundle of what the tree is for.
        files: by name in the bundle.
        packages: folders of the packages that models in it name.
    """

    anchor: str
    files: Mapping[str, Path]
    packages: Mapping[str, Path]

    @classmethod
    def of(
        cls,
        top: str,
        anchor: Path,
        models: Iterable[Path],
        others: Iterable[Path],
        packages: Packages,
    ) -> _BundleTree:
        """The tree of some models.

        Args:
            top: folder in the bundle for what is in no package.
            anchor: a file or folder.
            models: with the files that they name.
            others: more files.
            packages: where packages are looked for.
        """
        models = [model for model in models if model.is_file()]
        folders = {n: f.resolve() for m in models for n, f in named_packages(m, packages).items()}
        sought = (packages, NO_PACKAGES)  # as the simulation finds them, and the content's hash
        named = [file for model in models for p in sought for file in named_files(model, p)]
        anchor = Path(os.path.abspath(anchor))
        files = [Path(os.path.abspath(file)) for file in (*models, *others, *named)]
        files = [file for file in dict.fromkeys(files) if file.is_file()]
        outside = [file for file in files if _package(file, folders) is None]
        around = anchor if anchor.is_dir() else anchor.parent
        base = Path(os.path.commonpath([around, *(file.parent for file in outside)]))

        def name(path: Path) -> str:
            package = _package(path, folders)
            if package is None:
                return (PurePosixPath(top) / path.relative_to(base).as_posix()).as_posix()
            inside = path.relative_to(folders[package])
            return (PurePosixPath(package) / inside.as_posix()).as_posix()

        return cls(name(anchor), {name(file): file for file in files}, folders)

    def with_looks(self) -> _BundleTree:
        """The same with the materials and textures that its meshes refer to."""
        beside = {
            (PurePosixPath(name).parent / file.relative_to(path.parent).as_posix()).as_posix(): file
            for name, path in self.files.items()
            for file in companions(path)
        }
        return replace(self, files=beside | dict(self.files))


def _package(path: Path, folders: Mapping[str, Path]) -> str | None:
    """The package that a file is in; of several, the innermost."""
    inside = [name for name, folder in folders.items() if path.is_relative_to(folder)]
    return max(inside, key=lambda name: len(folders[name].parts), default=None)


def _manifest(name: str, folder: Path) -> bytes:
    """By which a package is known wherever it is; one that has none gets one."""
    manifest = folder / MANIFEST
    return _bytes(manifest) if manifest.is_file() else package_manifest(name, "").encode()


def _bytes(path: Path) -> bytes:
    with open_regular(path) as stream:
        return stream.read()


def _zipped(contents: Mapping[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        for name in sorted(contents):
            info = zipfile.ZipInfo(name, LONG_AGO)
            info.compress_type, info.create_system = zipfile.ZIP_DEFLATED, 3
            info.external_attr = 0o644 << 16
            archive.writestr(info, contents[name])
    return buffer.getvalue()
