"""The stages of one object's build, each with a key that follows from what it is made from.

The keys and the figures that later stages need are kept in `build.json` beside the object's files:
a new mass then rewrites the SDF and nothing else, and an object that has not changed is not even
loaded.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any, cast

import numpy as np
import trimesh

from burg_drake.core.content import content_hash
from burg_drake.core.files import atomic_write
from burg_drake.core.schema import Pose, Vector3
from burg_drake.objects.decompose import convex_pieces, given_pieces
from burg_drake.objects.library import MassProperties, ObjectEntry, Source, StablePose
from burg_drake.objects.mass import (
    DEFAULT_DENSITY,
    Solid,
    mass_properties,
    solid_of_pieces,
    solid_of_surface,
)
from burg_drake.objects.meshes import SurfaceMesh, load_mesh, mesh_hash, texture_image
from burg_drake.objects.obj_file import write_piece, write_visual
from burg_drake.objects.sdf import DEFAULT_CONTACT, model_sdf
from burg_drake.objects.stable_poses import stable_poses
from burg_drake.pipeline.source import ObjectSource, check_source

VERSION = 1
"""Raise it when a stage gives other results for the same input; everything is then built anew."""

RECORD_FILE = "build.json"
MESH_FILE = "mesh.obj"
PIECES_FOLDER = "pieces"
PIECE_DECIMALS = 7
"""Vertices of pieces are rounded to 0.1 um, so that files hold exactly what was computed with."""


@dataclass(frozen=True)
class StageKeys:
    """Content hashes of what each stage is made from.

    Attributes:
        file: SHA-256 of the mesh file's bytes; of the arrays for a mesh in memory.
        visual: the visual mesh.
        pieces: the convex pieces, and what follows from them: volume, stable poses.
        build: everything, `ObjectEntry.build`.
    """

    file: str
    visual: str
    pieces: str
    build: str


@dataclass(frozen=True)
class Record:
    """What `build.json` holds.

    Attributes:
        keys: of the last build.
        files: file names in the object's folder.
        faces: of the repaired surface.
        repairs: made to the surface.
        closed: whether the surface is watertight.
        lower, upper: bounds [m].
        volume, p_OOcm, G_OOcm: see `mass.Solid`; the matrix by rows.
        pieces_volume: sum of the pieces' volumes over `volume`.
        stable_poses: probability, translation and quaternion of each.
    """

    keys: StageKeys
    pieces: tuple[str, ...]
    faces: int
    repairs: tuple[str, ...]
    closed: bool
    lower: Vector3
    upper: Vector3
    volume: float
    p_OOcm: Vector3
    G_OOcm: tuple[float, ...]
    pieces_volume: float
    stable_poses: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Built:
    """A built or updated object.

    Attributes:
        folder: where its files are, to be moved into the library; None if they are in place.
        entry: for the library.
        record: what `build.json` holds.
        notes: remarks for the user.
        seconds: CPU time by stage.
    """

    folder: Path | None
    entry: ObjectEntry
    record: Record
    notes: tuple[str, ...] = ()
    seconds: dict[str, float] = field(default_factory=dict)


def stage_keys(source: ObjectSource) -> StageKeys:
    """Keys of all stages; reads the mesh file's bytes, but builds nothing.

    Raises:
        MeshError: the mesh file cannot be read.
        InvalidInputError: a number of the source cannot be.
    """
    check_source(source)
    mesh = mesh_hash(source.mesh)
    given = None
    if source.pieces is not None:
        given = [(np.asarray(p.vertices), np.asarray(p.faces)) for p in source.pieces]
    visual = content_hash(VERSION, "visual", mesh, float(source.scale), source.rgba)
    maker = [_coacd_version()] if given is None else []
    pieces = content_hash(
        VERSION, "pieces", mesh, float(source.scale), given, asdict(source.decomposition), *maker
    )
    numbers = (source.mass, source.density, source.coefficient)
    build = content_hash(
        VERSION,
        visual,
        pieces,
        source.name,
        [None if n is None else float(n) for n in numbers],
        DEFAULT_DENSITY,
        asdict(DEFAULT_CONTACT),
    )
    in_memory = isinstance(source.mesh, trimesh.Trimesh)
    file = mesh if in_memory else hashlib.sha256(Path(source.mesh).read_bytes()).hexdigest()
    return StageKeys(file, visual, pieces, build)


def _coacd_version() -> str:
    """Other versions of CoACD may cut the same mesh otherwise."""
    try:
        return metadata.version("coacd")
    except metadata.PackageNotFoundError:
        return ""


def is_current(entry: ObjectEntry, keys: StageKeys, source: ObjectSource, root: Path) -> bool:
    """Whether the library holds just what these keys and the source ask for."""
    record = read_record(root / source.name)
    return (
        record is not None
        and record.keys == keys
        and entry.build == keys.build
        and entry.description == source.description
        and entry.source.file == file_name(source)
        and all((root / p).exists() for p in (entry.mesh, entry.sdf, *entry.pieces))
    )


def build_object(source: ObjectSource, keys: StageKeys, root: Path, scratch: Path) -> Built:
    """Builds an object, or what of it has changed.

    Args:
        source: what to build.
        keys: its stage keys.
        root: the library's folder; files in the object's folder are used again where they can.
        scratch: empty folder to build in.

    Raises:
        BurgError: the object cannot be built.
    """
    home = root / source.name
    record = read_record(home)
    seconds: dict[str, float] = {}
    folder: Path | None = None
    if not (
        record is not None
        and (record.keys.visual, record.keys.pieces) == (keys.visual, keys.pieces)
        and all((home / name).exists() for name in (MESH_FILE, *record.pieces))
    ):
        folder = scratch
        record = _build_geometry(source, keys, home, record, scratch, seconds)
    properties = mass_properties(
        Solid(record.volume, np.array(record.p_OOcm), np.reshape(record.G_OOcm, (3, 3))),
        source.mass,
        source.density,
    )
    entry = _entry(source, keys, record, properties)
    record = Record(**{**vars(record), "keys": keys})
    sdf = model_sdf(source.name, properties, source.coefficient, MESH_FILE, record.pieces)
    target = home if folder is None else folder
    # The record goes first: after a kill in between, it matches no entry and is built again.
    atomic_write(target / RECORD_FILE, json.dumps(asdict(record), indent=1) + "\n")
    atomic_write(target / f"{source.name}.sdf", sdf)
    notes = []
    if source.mass is None:
        used = DEFAULT_DENSITY if source.density is None else source.density
        why = "no mass or density given" if source.density is None else "no mass given"
        notes.append(f"{why}: {properties.mass:.4g} kg from {used:g} kg/m^3")
    if not record.closed:
        notes.append("the mesh is not closed; its volume is that of the convex pieces")
    return Built(folder, entry, record, tuple(notes), seconds)


def read_record(home: Path) -> Record | None:
    """The record in an object's folder, or None where there is none that can be read."""
    try:
        data: dict[str, Any] = json.loads((home / RECORD_FILE).read_text())
        data["keys"] = StageKeys(**data["keys"])
        data = {k: tuple(v) if isinstance(v, list) else v for k, v in data.items()}
        return Record(**data)
    except (OSError, ValueError, TypeError, KeyError):
        return None


def file_name(source: ObjectSource) -> str:
    """Name of the mesh file, empty for a mesh in memory."""
    return "" if isinstance(source.mesh, trimesh.Trimesh) else Path(source.mesh).name


def _build_geometry(
    source: ObjectSource,
    keys: StageKeys,
    home: Path,
    before: Record | None,
    folder: Path,
    seconds: dict[str, float],
) -> Record:
    with _timed(seconds, "mesh"):
        mesh = load_mesh(source.mesh, source.scale)
    with _timed(seconds, "pieces"):
        pieces, child = _pieces(source, keys, home, before, mesh)
        names = tuple(f"{PIECES_FOLDER}/{i:03d}.obj" for i in range(len(pieces)))
        for name, piece in zip(names, pieces, strict=True):
            write_piece(piece, folder / name)
    seconds["pieces"] += child
    with _timed(seconds, "mass"):
        solid = solid_of_surface(mesh.surface) if mesh.closed else solid_of_pieces(pieces)
    with _timed(seconds, "stable_poses"):
        support = np.vstack([p.vertices for p in pieces])
        poses = stable_poses(mesh.surface, support, solid.p_OOcm)
    with _timed(seconds, "visual"):
        image = texture_image(mesh.visual)
        rgba = source.rgba if source.rgba is not None else mesh.rgba
        write_visual(mesh.visual, folder / MESH_FILE, rgba=rgba, image=image)
    lower, upper = mesh.surface.bounds
    return Record(
        keys=keys,
        pieces=names,
        faces=len(mesh.surface.faces),
        repairs=mesh.repairs,
        closed=mesh.closed,
        lower=_vector(lower),
        upper=_vector(upper),
        volume=solid.volume,
        p_OOcm=_vector(solid.p_OOcm),
        G_OOcm=tuple(solid.G_OOcm.reshape(-1).tolist()),
        pieces_volume=float(sum(p.volume for p in pieces) / solid.volume),
        stable_poses=tuple(
            (p.probability, *p.X_SO.translation, *cast(tuple, p.X_SO.quaternion_wxyz))
            for p in poses
        ),
    )


def _pieces(
    source: ObjectSource, keys: StageKeys, home: Path, before: Record | None, mesh: SurfaceMesh
) -> tuple[tuple[trimesh.Trimesh, ...], float]:
    """The pieces, rounded as they are written, and the CPU time of child processes [s]."""
    if before is not None and before.keys.pieces == keys.pieces:
        files = [home / name for name in before.pieces]
        if all(file.exists() for file in files):
            return tuple(trimesh.load_mesh(file, process=False) for file in files), 0.0
    if source.pieces is not None:
        pieces = given_pieces(source.pieces)
    else:
        pieces = convex_pieces(mesh.surface, mesh.closed, source.decomposition)
    rounded = (np.round(p.vertices, PIECE_DECIMALS) + 0.0 for p in pieces.meshes)
    meshes = (
        trimesh.Trimesh(vertices, piece.faces, process=False)
        for vertices, piece in zip(rounded, pieces.meshes, strict=True)
    )
    return tuple(meshes), pieces.seconds


def _entry(
    source: ObjectSource, keys: StageKeys, record: Record, properties: MassProperties
) -> ObjectEntry:
    return ObjectEntry(
        description=source.description,
        mesh=f"{source.name}/{MESH_FILE}",
        sdf=f"{source.name}/{source.name}.sdf",
        pieces=tuple(f"{source.name}/{name}" for name in record.pieces),
        friction=source.coefficient,
        lower=record.lower,
        upper=record.upper,
        mass_properties=properties,
        stable_poses=tuple(
            StablePose(
                probability=p[0],
                X_SO=Pose(
                    translation=cast(Vector3, tuple(p[1:4])),
                    quaternion_wxyz=cast("tuple[float, float, float, float]", tuple(p[4:])),
                ),
            )
            for p in record.stable_poses
        ),
        source=Source(
            file=file_name(source), sha256=keys.file, scale=source.scale, repairs=record.repairs
        ),
        build=keys.build,
    )


def _vector(values: Any) -> Vector3:
    return cast(Vector3, tuple(np.asarray(values, dtype=float).tolist()))


@contextmanager
def _timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    start = time.thread_time()
    yield
    seconds[stage] = time.thread_time() - start
