"""Packs scene, station and all files that Drake reads into one zip; builds judges from it."""

from __future__ import annotations

import hashlib
import io
import json
import os
import pickle
import zipfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from burg_drake.core import (
    NO_PACKAGES,
    InvalidInputError,
    Mode,
    Packages,
    dump_document,
    load_document,
    open_regular,
    referenced_files,
    referenced_packages,
)
from burg_drake.evaluation.cluster.unpacked_bundle import JudgeRecipe
from burg_drake.evaluation.judge import Judge, StationJudge, StationJudgeFactory
from burg_drake.objects import LIBRARY_FILE, find_companion_files, load_library, package_manifest
from burg_drake.scene import Scene, SceneDocument
from burg_drake.station import Engine, Hand, Station, StationDocument, world_content

if TYPE_CHECKING:
    from burg_drake.simulation import TrialSettings


class BundleFiles:
    """Names of the files at the top of a bundle."""

    places = "places.json"  # Paths of the model files in the bundle.
    scene = "scene.yaml"  # Scene document.
    station = "station.yaml"  # Station document.
    hand = "hand.yaml"  # Hand document.


@dataclass(frozen=True)
class Bundle:
    """A packed world.

    Attributes:
        name: SHA-256 of `data`.
        data: a zip.
        content: `world_content` of scene and station.
        scene_content, station_content: hashes of scene and of station, to name what differs.
    """

    name: str
    data: bytes
    content: str
    scene_content: str
    station_content: str


def make_bundle(scene: Scene, station: Station, *, looks: bool = False) -> Bundle:
    """Packs a scene and a station.

    Args:
        scene, station: scene and station to pack.
        looks: include materials and textures, which only images need.

    Raises:
        MeshError: a texture is too large.
        InvalidInputError: a file cannot be read.
        UnknownNameError: a model refers to an unknown package.
    """
    used = {i.object: None for i in (*scene.instances.values(), *scene.background.values())}
    entries = {name: scene.library.entry(name) for name in used}
    root = Path(os.path.abspath(scene.library.root))
    own = [root / file for entry in entries.values() for file in entry.files]
    models = [root / entry.sdf for entry in entries.values()]
    packages = station.packages
    # Package names have no dot, so they cannot clash with these folders.
    trees = [_BundleTree.of("library.d", root, models, own, packages)]
    for folder, model in (("hand.d", station.hand_model), ("arm.d", station.arm_model)):
        if model is not None:
            trees.append(_BundleTree.of(folder, model, [model], [], packages))
    if looks:
        trees = [tree.with_visual_files() for tree in trees]
    folders = {name: folder for tree in trees for name, folder in tree.packages.items()}
    library, hand, *arm = (tree.anchor for tree in trees)
    places = {
        "library": library,
        "hand_model": hand,
        "arm_model": arm[0] if arm else None,
        "packages": sorted(folders),
    }
    contents = {f"{n}/package.xml": _manifest_bytes(n, folder) for n, folder in folders.items()}
    contents |= {name: _read_bytes(path) for tree in trees for name, path in tree.files.items()}
    objects = replace(scene.library.document, objects=entries)
    contents |= {
        BundleFiles.places: json.dumps(places, indent=1).encode(),
        BundleFiles.scene: dump_document(replace(scene.document, origin=None, library="")).encode(),
        BundleFiles.station: dump_document(replace(station.document, packages={})).encode(),
        BundleFiles.hand: dump_document(station.hand).encode(),
        f"{library}/{LIBRARY_FILE}": dump_document(objects).encode(),
    }
    data = _zip_contents(contents)
    return Bundle(
        name=hashlib.sha256(data).hexdigest(),
        data=data,
        content=world_content(scene, station),
        scene_content=scene.content,
        station_content=station.content,
    )


def load_bundle(folder: Path) -> tuple[Scene, Station]:
    """Scene and station of a bundle that was unpacked into a folder."""
    places = json.loads((folder / BundleFiles.places).read_text())
    library = load_library(str(folder / places["library"] / LIBRARY_FILE))
    scene = Scene(
        load_document(folder / BundleFiles.scene, SceneDocument),
        library,
        folder / BundleFiles.scene,
    )
    packages = Packages({name: folder / name for name in places["packages"]})
    arm = places["arm_model"]
    station = Station(
        load_document(folder / BundleFiles.station, StationDocument),
        load_document(folder / BundleFiles.hand, Hand),
        folder / places["hand_model"],
        None if arm is None else folder / arm,
        folder / BundleFiles.station,
        folder / BundleFiles.hand,
        packages,
    )
    return scene, station


def require_same_content(bundle: Bundle, scene: Scene, station: Station) -> None:
    """Refuses a scene and station that differ from the packed ones.

    Args:
        bundle: bundle with the hashes; its data are not needed.
        scene, station: unpacked scene and station.

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
    """Files that keep their relative paths.

    Attributes:
        anchor: name in the bundle of the main file or folder.
        files: files by name in the bundle.
        packages: folders of the packages that the models refer to.
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
            top: folder in the bundle for files outside packages.
            anchor: a file or folder.
            models: model files, packed with the files that they refer to.
            others: more files.
            packages: where to look for packages.
        """
        models = [model for model in models if model.is_file()]
        folders = {
            n: f.resolve() for m in models for n, f in referenced_packages(m, packages).items()
        }
        sought = (packages, NO_PACKAGES)  # as for the simulation and the content hash
        named = [file for model in models for p in sought for file in referenced_files(model, p)]
        anchor = Path(os.path.abspath(anchor))
        files = [Path(os.path.abspath(file)) for file in (*models, *others, *named)]
        files = [file for file in dict.fromkeys(files) if file.is_file()]
        outside = [file for file in files if _package_of(file, folders) is None]
        around = anchor if anchor.is_dir() else anchor.parent
        base = Path(os.path.commonpath([around, *(file.parent for file in outside)]))

        def name(path: Path) -> str:
            package = _package_of(path, folders)
            folder, start = (top, base) if package is None else (package, folders[package])
            return (PurePosixPath(folder) / path.relative_to(start)).as_posix()

        return cls(name(anchor), {name(file): file for file in files}, folders)

    def with_visual_files(self) -> _BundleTree:
        """A copy with the materials and textures that the meshes refer to."""
        beside = {
            (PurePosixPath(name).parent / file.relative_to(path.parent).as_posix()).as_posix(): file
            for name, path in self.files.items()
            for file in find_companion_files(path)
        }
        return replace(self, files=beside | dict(self.files))


def _package_of(path: Path, folders: Mapping[str, Path]) -> str | None:
    """The innermost package that contains a file."""
    inside = [name for name, folder in folders.items() if path.is_relative_to(folder)]
    return max(inside, key=lambda name: len(folders[name].parts), default=None)


def _manifest_bytes(name: str, folder: Path) -> bytes:
    """The manifest that identifies a package; generated if the package has none."""
    manifest = folder / "package.xml"
    return _read_bytes(manifest) if manifest.is_file() else package_manifest(name, "").encode()


def _read_bytes(path: Path) -> bytes:
    with open_regular(path) as stream:
        return stream.read()


def _zip_contents(contents: Mapping[str, bytes]) -> bytes:
    entry_date = (1980, 1, 1, 0, 0, 0)  # Fixed, so that equal contents give equal bytes.
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        for name in sorted(contents):
            info = zipfile.ZipInfo(name, entry_date)
            info.compress_type, info.create_system = zipfile.ZIP_DEFLATED, 3
            info.external_attr = 0o644 << 16
            archive.writestr(info, contents[name])
    return buffer.getvalue()


@dataclass(frozen=True)
class BundledJudgeFactory:
    """A `StationJudgeFactory` whose scene and station are in an unpacked bundle.

    Attributes:
        bundle: name and hashes of the bundle, without data.
        engine, mode, settings: as in `StationJudgeFactory`.
        folder: where the bundle is unpacked; set by the worker.
    """

    bundle: Bundle
    engine: Engine
    mode: Mode
    settings: TrialSettings | None
    folder: Path | None = None

    def __call__(self) -> StationJudge:
        assert self.folder is not None
        scene, station = load_bundle(self.folder)
        require_same_content(self.bundle, scene, station)
        return StationJudgeFactory(scene, station, self.engine, self.mode, self.settings)()


def make_recipe(make_judge: Callable[[], Judge]) -> tuple[JudgeRecipe, Bundle | None]:
    """Recipe and bundle for a judge; no bundle if the factory contains no `StationJudgeFactory`.

    Raises:
        BurgError: see `make_bundle`.
    """
    buffer = io.BytesIO()
    packer = _Packer(buffer)
    packer.dump(make_judge)
    bundle = packer.bundle
    return JudgeRecipe(buffer.getvalue(), bundle.name if bundle else ""), bundle


class _Packer(pickle.Pickler):
    """Pickles objects, with a `BundledJudgeFactory` in place of any `StationJudgeFactory` in them.

    Attributes:
        bundle: scene and station of that factory.
    """

    def __init__(self, file: io.BytesIO) -> None:
        super().__init__(file)
        self.bundle: Bundle | None = None

    def persistent_id(self, value: Any) -> BundledJudgeFactory | None:
        if not isinstance(value, StationJudgeFactory):
            return None
        self.bundle = make_bundle(value.scene, value.station)
        hashes = replace(self.bundle, data=b"")
        return BundledJudgeFactory(hashes, value.engine, value.mode, value.settings)
