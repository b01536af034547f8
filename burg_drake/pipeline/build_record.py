"""Content hashes of build stages, and the record `build.json` in an object's folder.

The hashes tell which stages have to run again; the record also has results that later builds need.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from burg_drake.core import (
    DocumentError,
    Vector3,
    atomic_write,
    content_hash,
    load_document,
    load_json,
    package_version,
    plain_data,
)
from burg_drake.objects import (
    DEFAULT_CONTACT,
    DEFAULT_DENSITY,
    ContactGeometry,
    Fit,
    ObjectEntry,
    Solid,
    StablePose,
    mesh_hash,
)
from burg_drake.pipeline.decomposition import FINER_THRESHOLDS, MAX_PIECES
from burg_drake.pipeline.object_source import ObjectSource, check_source, piece_meshes

BUILD_VERSION = 3
"""Raise it when a stage gives other results for the same input; everything is then rebuilt."""


@dataclass(frozen=True)
class StageKeys:
    """Content hashes of the inputs of each build stage.

    Attributes:
        file: SHA-256 of the mesh file's bytes; of the arrays for a mesh in memory.
        mesh: hash of the mesh and of all files that its file refers to.
        visual: hash of the inputs of the visual mesh.
        pieces: hash of the inputs of the surface, its convex pieces, and their fit.
        rest: hash of the inputs of contact geometry, volume, centre of mass and stable poses.
        build: hash of all inputs, `ObjectEntry.build`.
    """

    file: str
    mesh: str
    visual: str
    pieces: str
    rest: str
    build: str


def stage_keys(source: ObjectSource, confirm: bool) -> StageKeys:
    """Computes the keys of all stages from the source and the bytes of its mesh file, without
    building.

    Args:
        source: object to build.
        confirm: whether stable poses are simulated.

    Raises:
        MeshError: the mesh file cannot be read.
        InvalidInputError: a number of the source is impossible.
    """
    # Raise it when only stable poses change. It is not in `build`, which seeds grasp sampling.
    poses_version = 2
    check_source(source)
    mesh = mesh_hash(source.mesh)
    given = None
    pieces_given = piece_meshes(source)
    if pieces_given is not None:
        given = [(np.asarray(p.vertices), np.asarray(p.faces)) for p in pieces_given]
    thickness = None if source.wall_thickness is None else float(source.wall_thickness)
    # Other versions of a package may give other results for the same mesh.
    makers = (package_version("trimesh", ""), package_version("manifold3d", ""))
    surface = (mesh, float(source.scale), thickness, source.openings, *makers)
    visual = content_hash(BUILD_VERSION, "opaque visual", *surface, _as_floats(source.rgba))
    maker = [package_version("coacd", ""), *FINER_THRESHOLDS, MAX_PIECES] if given is None else []
    pieces = content_hash(
        BUILD_VERSION, "pieces", *surface, given, asdict(source.decomposition), *maker
    )
    rest = content_hash(
        BUILD_VERSION,
        "rest",
        pieces,
        _as_floats(source.center_of_mass),
        source.contact,
        asdict(DEFAULT_CONTACT),
        [package_version("drake", "")] if confirm else None,
    )
    numbers = (source.mass, source.density, source.coefficient)
    build = content_hash(
        BUILD_VERSION,
        visual,
        rest,
        source.name,
        _as_floats(numbers),
        _as_floats(source.inertia),
        DEFAULT_DENSITY,
        asdict(DEFAULT_CONTACT),
        *(["fixed"] if source.fixed else []),
    )
    in_memory = isinstance(source.mesh, trimesh.Trimesh)
    rest = content_hash(rest, poses_version)
    file = mesh if in_memory else hashlib.sha256(Path(source.mesh).read_bytes()).hexdigest()
    return StageKeys(file, mesh, visual, pieces, rest, build)


def _as_floats(numbers: tuple[float | None, ...] | None) -> list[float | None] | None:
    """Numbers as floats, so that 1 and 1.0 are the same."""
    return None if numbers is None else [None if n is None else float(n) for n in numbers]


@dataclass(frozen=True, kw_only=True)
class ObjectGeometry:
    """Results of a build about an object's shape.

    Attributes:
        repairs: repairs of the surface.
        surface: file of the surface if it differs from the visual mesh; else empty.
        closed: whether the surface is watertight.
        wall: thickness of the wall that an open surface became [m]; None for other surfaces.
        lower, upper: corners of the bounding box [m].
        volume, p_OOcm, G_OOcm: see `Solid`; the matrix by rows.
        pieces: files of the convex pieces in the object's folder.
        threshold: threshold of the decomposition; None for pieces that came with the object.
        cut: note on steps of the decomposition that were not asked for; or empty.
        fit: fit of the pieces to the surface.
        contact: contact geometry; file names are relative to the object's folder.
        stable_poses: stable poses, most probable first.
        notes: remarks on the poses.
    """

    repairs: tuple[str, ...]
    surface: str = ""
    closed: bool
    wall: float | None = None
    lower: Vector3
    upper: Vector3
    volume: float
    p_OOcm: Vector3
    G_OOcm: tuple[float, ...]
    pieces: tuple[str, ...]
    threshold: float | None = None
    cut: str = ""
    fit: Fit | None
    contact: ContactGeometry
    stable_poses: tuple[StablePose, ...]
    notes: tuple[str, ...] = ()

    @property
    def solid(self) -> Solid:
        """Solid from which the mass properties are computed."""
        return Solid(self.volume, np.array(self.p_OOcm), np.reshape(self.G_OOcm, (3, 3)))


@dataclass(frozen=True, kw_only=True)
class BuildRecord:
    """Contents of `build.json`.

    Attributes:
        keys: stage keys of the last build.
        geometry: results of the last build.
        files: SHA-256 of each file in the object's folder, by name.
        entry: hash of the entry in `library.yaml`, see `entry_hash`.
    """

    version: int = BUILD_VERSION
    keys: StageKeys
    geometry: ObjectGeometry
    files: dict[str, str]
    entry: str


def write_record(home: Path, record: BuildRecord) -> None:
    """Writes the record of an object's folder."""
    atomic_write(home / "build.json", json.dumps(plain_data(record), indent=1) + "\n")


def read_record(home: Path) -> BuildRecord | None:
    """Reads the record of an object's folder; None if there is none that this release can read."""
    try:
        return load_document(home / "build.json", BuildRecord)
    except DocumentError:
        return None


def is_as_built(home: Path, keys: StageKeys, entry: ObjectEntry) -> bool:
    """Whether a folder and the library entry are unchanged since a build with these keys."""
    data = _read_raw_record(home)
    if data is None or data.get("version") != BUILD_VERSION:
        return False
    return (
        data.get("keys") == asdict(keys)
        and data.get("entry") == entry_hash(entry)
        and data.get("files") == file_hashes(home)
    )


def files_are_intact(home: Path, record: BuildRecord, names: Iterable[str]) -> bool:
    """Whether files of an object's folder are unchanged since the build."""
    found = file_hashes(home)
    return all(name in found and found[name] == record.files.get(name) for name in names)


def entry_hash(entry: ObjectEntry) -> str:
    """SHA-256 of an entry; the same before and after writing it to a document."""
    return hashlib.sha256(json.dumps(plain_data(entry)).encode()).hexdigest()


def is_object_folder(home: Path) -> bool:
    """Whether a folder was made by a build of any release."""
    data = _read_raw_record(home)
    return data is not None and "keys" in data


def touched_by_pieces(home: Path) -> bool:
    """Whether pads touch the convex pieces of the object in a folder, built by any release."""
    data = _read_raw_record(home) or {}
    geometry = data.get("geometry")
    if not isinstance(geometry, dict):
        return False
    contact = geometry.get("contact", {})
    return isinstance(contact, dict) and contact.get("kind", "pieces") == "pieces"


def file_hashes(home: Path) -> dict[str, str]:
    """SHA-256 by name of all files of an object's folder except the record."""
    files = sorted(p for p in home.rglob("*") if p.is_file() and p.name != "build.json")
    return {
        p.relative_to(home).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest() for p in files
    }


def _read_raw_record(home: Path) -> dict[str, Any] | None:
    try:
        data = load_json(home / "build.json")
    except DocumentError:
        return None
    return data if isinstance(data, dict) else None
