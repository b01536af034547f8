"""Stages of one object's build: surface, pieces, contact, mass, stable poses, visual, SDF, entry.

A stage runs only if its inputs have changed.
"""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import trimesh

from burg_drake.core import MESH_FILE, Array, Vector3, atomic_write
from burg_drake.objects import (
    DEFAULT_DENSITY,
    DEFAULT_FRICTION,
    ContactGeometry,
    LibraryDocument,
    MassProperties,
    ObjectEntry,
    ObjectLibrary,
    Preparation,
    Solid,
    Source,
    StablePose,
    SurfaceMesh,
    SymmetrySearch,
    contact_fallback_message,
    contact_geometry,
    deviation_warning,
    implausible_properties,
    load_mesh,
    mass_properties,
    missing_textures,
    model_sdf,
    primitive_mesh,
    solid_of_pieces,
    solid_of_shell,
    solid_of_surface,
    stable_poses,
    texture_image,
    write_piece,
    write_visual,
)
from burg_drake.pipeline.build_record import (
    BuildRecord,
    ObjectGeometry,
    StageKeys,
    entry_hash,
    file_hashes,
    files_are_intact,
    is_as_built,
    read_record,
    touched_by_pieces,
    write_record,
)
from burg_drake.pipeline.decomposition import ObjectPieces, cut_into_pieces
from burg_drake.pipeline.object_source import ObjectSource

PieceMeshes = tuple[trimesh.Trimesh, ...]


def build_geometry(
    source: ObjectSource,
    keys: StageKeys,
    home: Path,
    folder: Path,
    confirm: bool,
    seconds: dict[str, float],
) -> ObjectGeometry:
    """Builds everything but the final SDF.

    Args:
        source: object to build.
        keys: stage keys of the source.
        home: the object's folder in the library; unchanged pieces in it are reused.
        folder: folder to write to, with the object's name.
        confirm: simulate the stable poses.
        seconds: filled with the CPU time by stage.

    Raises:
        BurgError: the object cannot be built.
    """
    with _time_stage(seconds, "mesh"):
        preparation = Preparation(wall_thickness=source.wall_thickness, openings=source.openings)
        mesh = load_mesh(source.mesh, source.scale, preparation)
    with _time_stage(seconds, "pieces"):
        made = _reuse_or_cut_pieces(source, keys, home, mesh)
        pieces = made.pieces
        names = tuple(f"pieces/{i:03d}.obj" for i in range(len(pieces)))
        for name, piece in zip(names, pieces, strict=True):
            write_piece(piece, folder / name)
    seconds["pieces"] += made.seconds
    with _time_stage(seconds, "mass"):
        solid, wall = _make_solid(source, mesh, pieces)
    with _time_stage(seconds, "fit"):
        contact = contact_geometry(source.contact, mesh.surface, mesh.closed, pieces, folder)
    with _time_stage(seconds, "visual"):
        image = texture_image(mesh.visual)
        rgba = source.rgba if source.rgba is not None else mesh.rgba
        write_visual(mesh.visual, folder / MESH_FILE, rgba=rgba, image=image)
        apart = mesh.wall is not None or len(mesh.surface.faces) != len(mesh.visual.faces)
        if apart:
            write_piece(mesh.surface, folder / "surface.obj")
    with _time_stage(seconds, "stable_poses"):
        p_OOcm = solid.p_OOcm if source.center_of_mass is None else np.array(source.center_of_mass)
        search = SymmetrySearch(mesh.surface, p_OOcm)
        poses = stable_poses(mesh.surface, _support_points(contact, pieces), p_OOcm, search)
    lower, upper = mesh.surface.bounds
    geometry = ObjectGeometry(
        repairs=mesh.repairs,
        surface="surface.obj" if apart else "",
        closed=mesh.closed,
        wall=wall,
        lower=_as_vector3(lower),
        upper=_as_vector3(upper),
        volume=solid.volume,
        p_OOcm=_as_vector3(solid.p_OOcm),
        G_OOcm=tuple(solid.G_OOcm.reshape(-1).tolist()),
        pieces=names,
        threshold=made.threshold,
        cut=made.note,
        fit=made.fit,
        contact=contact,
        stable_poses=poses,
    )
    if not confirm:
        return geometry
    with _time_stage(seconds, "confirm"):
        poses, notes = _confirm_poses(source, geometry, folder, search)
    return replace(geometry, stable_poses=poses, notes=notes)


def _reuse_or_cut_pieces(
    source: ObjectSource, keys: StageKeys, home: Path, mesh: SurfaceMesh
) -> ObjectPieces:
    """The convex pieces, from an earlier build if their inputs have not changed."""
    before = read_record(home)
    if before is not None and before.keys.pieces == keys.pieces:
        known = before.geometry
        if files_are_intact(home, before, known.pieces):
            files = [home / name for name in known.pieces]
            pieces = tuple(trimesh.load_mesh(file, process=False) for file in files)
            return ObjectPieces(pieces, known.fit, known.threshold, known.cut)
    return cut_into_pieces(source, mesh)


def _make_solid(
    source: ObjectSource, mesh: SurfaceMesh, pieces: Sequence[trimesh.Trimesh]
) -> tuple[Solid, float | None]:
    """The solid of the object's material, and the thickness of its wall if it is hollow [m]."""
    if not mesh.closed:
        return solid_of_pieces(pieces), None
    if mesh.wall is not None or source.wall_thickness is None:
        return solid_of_surface(mesh.surface), mesh.wall
    return solid_of_shell(mesh.surface, source.wall_thickness), source.wall_thickness


def _support_points(contact: ContactGeometry, pieces: PieceMeshes) -> Array:
    """(N, 3) points of O whose hull rests on a plane [m]."""
    if contact.primitive is not None:
        return np.asarray(primitive_mesh(contact.primitive).vertices)
    return np.vstack([piece.vertices for piece in pieces])


def _confirm_poses(
    source: ObjectSource, geometry: ObjectGeometry, folder: Path, search: SymmetrySearch
) -> tuple[tuple[StablePose, ...], tuple[str, ...]]:
    """The stable poses that pass the test in simulation, and remarks on the others.

    The test has its own mass and friction, independent of the object's.
    """
    from burg_drake.simulation import confirm_poses  # imports Drake

    properties = mass_properties(geometry.solid, center_of_mass=source.center_of_mass)
    name = source.name
    sdf = model_sdf(
        name, properties, DEFAULT_FRICTION, MESH_FILE, geometry.pieces, geometry.contact
    )
    atomic_write(folder / f"{name}.sdf", sdf)
    entry = ObjectEntry(
        **_geometry_fields(name, geometry),
        mass_properties=properties,
        source=Source(file="", sha256=""),
        build="",
    )
    document = LibraryDocument(name="resting", objects={name: entry})
    confirmation = confirm_poses(ObjectLibrary(document, folder.parent), name, search)
    return confirmation.poses, confirmation.notes


def _geometry_fields(name: str, geometry: ObjectGeometry) -> dict[str, Any]:
    """Fields of the entry of object `name`; its files are relative to the library's folder."""
    contact = geometry.contact
    return {
        "mesh": f"{name}/{MESH_FILE}",
        "sdf": f"{name}/{name}.sdf",
        "pieces": tuple(f"{name}/{piece}" for piece in geometry.pieces),
        "contact": replace(contact, mesh=f"{name}/{contact.mesh}") if contact.mesh else contact,
        "lower": geometry.lower,
        "upper": geometry.upper,
        "stable_poses": geometry.stable_poses,
    }


def _as_vector3(values: Any) -> Vector3:
    return cast(Vector3, tuple(np.asarray(values, dtype=float).tolist()))


@contextmanager
def _time_stage(seconds: dict[str, float], stage: str) -> Iterator[None]:
    start = time.thread_time()
    yield
    seconds[stage] = time.thread_time() - start


@dataclass(frozen=True)
class BuiltObject:
    """A built or updated object.

    Attributes:
        folder: folder with its files, to be moved into the library; None if they are in place.
        entry: entry for the library.
        notes: remarks for the user.
        seconds: CPU time by stage.
    """

    folder: Path | None
    entry: ObjectEntry
    notes: tuple[str, ...] = ()
    seconds: dict[str, float] = field(default_factory=dict)


def is_current(
    entry: ObjectEntry, keys: StageKeys, source: ObjectSource, root: Path, confirm: bool
) -> bool:
    """Whether the object in the library is up to date with these keys and the source."""
    return (
        entry.build == keys.build
        and entry.description == source.description
        and (entry.source.file, entry.source.path) == _mesh_origin(source, root)
        and not (confirm and _lacks_confirmation(entry.stable_poses))
        and is_as_built(root / source.name, keys, entry)
    )


def _lacks_confirmation(poses: Sequence[StablePose]) -> bool:
    """Whether the simulation of poses failed, so that it should be repeated."""
    return any(pose.residual is None for pose in poses)


def build_object(
    source: ObjectSource, keys: StageKeys, root: Path, scratch: Path, confirm: bool = True
) -> BuiltObject:
    """Builds an object, or the stages of it that have changed.

    Args:
        source: object to build.
        keys: stage keys of the source.
        root: the library's folder; unchanged files in the object's folder are reused.
        scratch: empty folder to build in, with the object's name.
        confirm: simulate the stable poses.

    Raises:
        BurgError: the object cannot be built.
    """
    home = root / source.name
    before, had_pieces = read_record(home), touched_by_pieces(home)
    seconds: dict[str, float] = {}
    folder: Path | None = None
    if (
        before is not None
        and (before.keys.visual, before.keys.rest) == (keys.visual, keys.rest)
        and not (confirm and _lacks_confirmation(before.geometry.stable_poses))
        and files_are_intact(
            home, before, (name for name in before.files if not name.endswith(".sdf"))
        )
    ):
        geometry = before.geometry
    else:
        folder = scratch
        geometry = build_geometry(source, keys, home, scratch, confirm, seconds)
    properties = mass_properties(
        geometry.solid,
        source.mass,
        source.density,
        center_of_mass=source.center_of_mass,
        inertia=source.inertia,
        wall_thickness=geometry.wall,
        bounds=np.array([geometry.lower, geometry.upper]),
    )
    if source.fixed:
        properties = replace(properties, source="fixed")
    sdf = model_sdf(
        source.name, properties, source.coefficient, MESH_FILE, geometry.pieces, geometry.contact
    )
    entry = _make_entry(source, keys, geometry, properties, root)
    target = home if folder is None else folder
    files = file_hashes(target) | {f"{source.name}.sdf": hashlib.sha256(sdf.encode()).hexdigest()}
    record = BuildRecord(keys=keys, geometry=geometry, files=files, entry=entry_hash(entry))
    # The record is written first: after a kill in between, it matches no SDF, and the object is
    # built again.
    write_record(target, record)
    atomic_write(target / f"{source.name}.sdf", sdf)
    notes = _build_notes(source, geometry, properties)
    if had_pieces and geometry.contact.kind == "surface":
        notes.append("built again: finger pads now touch the object's own surface")
    return BuiltObject(folder, entry, tuple(notes), seconds)


def _build_notes(
    source: ObjectSource, geometry: ObjectGeometry, properties: MassProperties
) -> list[str]:
    """Remarks for the user about a built object."""
    notes = []
    if source.mass is None and not source.fixed:
        used = DEFAULT_DENSITY if source.density is None else source.density
        why = "no mass or density given" if source.density is None else "no mass given"
        notes.append(f"{why}: computed {properties.mass:.4g} kg from volume and {used:g} kg/m^3")
    if not geometry.closed:
        notes.append("the mesh is not closed; its volume is that of the convex pieces")
    if not isinstance(source.mesh, trimesh.Trimesh):
        notes += missing_textures(Path(source.mesh))
    notes += implausible_properties(properties, geometry.lower, geometry.upper)
    diagonal = float(np.linalg.norm(np.subtract(geometry.upper, geometry.lower)))
    notes.append(contact_fallback_message(geometry.contact, len(geometry.pieces)))
    coarse = deviation_warning(geometry.fit, diagonal, geometry.threshold)
    notes += [geometry.cut, coarse, *geometry.notes]
    return [note for note in notes if note]


def _mesh_origin(source: ObjectSource, root: Path) -> tuple[str, str]:
    """Name of the mesh file, and its path relative to the library; empty for a mesh in memory."""
    if isinstance(source.mesh, trimesh.Trimesh):
        return "", ""
    mesh = Path(source.mesh)
    known = os.path.relpath(os.path.realpath(mesh), os.path.realpath(root))
    return mesh.name, Path(known).as_posix()


def _make_entry(
    source: ObjectSource,
    keys: StageKeys,
    geometry: ObjectGeometry,
    properties: MassProperties,
    root: Path,
) -> ObjectEntry:
    file, path = _mesh_origin(source, root)
    decomposition = None
    if source.pieces is None:
        threshold = geometry.threshold or source.decomposition.threshold
        decomposition = replace(source.decomposition, threshold=threshold)
    return ObjectEntry(
        **_geometry_fields(source.name, geometry),
        description=source.description,
        surface=f"{source.name}/{geometry.surface}" if geometry.surface else "",
        decomposition=decomposition,
        fit=geometry.fit,
        friction=source.coefficient,
        mass_properties=properties,
        source=Source(
            file=file, path=path, sha256=keys.file, scale=source.scale, repairs=geometry.repairs
        ),
        build=keys.build,
    )
