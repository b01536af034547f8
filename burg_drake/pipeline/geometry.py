"""An object's geometry: surface, convex pieces, what touches, volume, stable poses, visual."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import trimesh

from burg_drake.core import Array
from burg_drake.core.documents import Vector3
from burg_drake.core.files import atomic_write
from burg_drake.core.paths import MESH_FILE, SURFACE_FILE
from burg_drake.objects.collision import contact_geometry, primitive_mesh
from burg_drake.objects.library import (
    DEFAULT_FRICTION,
    ContactGeometry,
    LibraryDocument,
    ObjectEntry,
    ObjectLibrary,
    Source,
    StablePose,
    model_sdf,
    write_piece,
    write_visual,
)
from burg_drake.objects.meshes import Preparation, SurfaceMesh, load_mesh, texture_image
from burg_drake.objects.physics import (
    Solid,
    SymmetrySearch,
    mass_properties,
    solid_of_pieces,
    solid_of_shell,
    solid_of_surface,
    stable_poses,
)
from burg_drake.pipeline.cutting import Cut, cut
from burg_drake.pipeline.keys import StageKeys
from burg_drake.pipeline.record import Geometry, intact, read_record
from burg_drake.pipeline.source import ObjectSource

PIECES_FOLDER = "pieces"
PieceMeshes = tuple[trimesh.Trimesh, ...]


def build_geometry(
    source: ObjectSource,
    keys: StageKeys,
    home: Path,
    folder: Path,
    confirm: bool,
    seconds: dict[str, float],
) -> Geometry:
    """Builds everything but the final SDF.

    Args:
        source: what to build.
        keys: its stage keys.
        home: the object's folder in the library; pieces in it are used again where they can.
        folder: where to write; has the object's name.
        confirm: simulate the stable poses.
        seconds: gets the CPU time by stage.

    Raises:
        BurgError: the object cannot be built.
    """
    with _timed(seconds, "mesh"):
        preparation = Preparation(wall_thickness=source.wall_thickness, openings=source.openings)
        mesh = load_mesh(source.mesh, source.scale, preparation)
    with _timed(seconds, "pieces"):
        made = _pieces(source, keys, home, mesh)
        pieces = made.pieces
        names = tuple(f"{PIECES_FOLDER}/{i:03d}.obj" for i in range(len(pieces)))
        for name, piece in zip(names, pieces, strict=True):
            write_piece(piece, folder / name)
    seconds["pieces"] += made.seconds
    with _timed(seconds, "mass"):
        solid, wall = _solid(source, mesh, pieces)
    with _timed(seconds, "fit"):
        contact, _ = contact_geometry(source.contact, mesh.surface, mesh.closed, pieces, folder)
    with _timed(seconds, "visual"):
        image = texture_image(mesh.visual)
        rgba = source.rgba if source.rgba is not None else mesh.rgba
        write_visual(mesh.visual, folder / MESH_FILE, rgba=rgba, image=image)
        apart = mesh.wall is not None or len(mesh.surface.faces) != len(mesh.visual.faces)
        if apart:
            write_piece(mesh.surface, folder / SURFACE_FILE)
    with _timed(seconds, "stable_poses"):
        p_OOcm = solid.p_OOcm if source.center_of_mass is None else np.array(source.center_of_mass)
        search = SymmetrySearch(mesh.surface, p_OOcm)
        poses = stable_poses(mesh.surface, _support(contact, pieces), p_OOcm, search)
    lower, upper = mesh.surface.bounds
    geometry = Geometry(
        repairs=mesh.repairs,
        surface=SURFACE_FILE if apart else "",
        closed=mesh.closed,
        wall=wall,
        lower=_vector(lower),
        upper=_vector(upper),
        volume=solid.volume,
        p_OOcm=_vector(solid.p_OOcm),
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
    with _timed(seconds, "confirm"):
        poses, notes = _confirmed(source, geometry, folder, search)
    return replace(geometry, stable_poses=poses, notes=notes)


def _pieces(source: ObjectSource, keys: StageKeys, home: Path, mesh: SurfaceMesh) -> Cut:
    """The pieces; those of an earlier build where nothing of them has changed."""
    before = read_record(home)
    if before is not None and before.keys.pieces == keys.pieces:
        known = before.geometry
        if intact(home, before, known.pieces):
            files = [home / name for name in known.pieces]
            pieces = tuple(trimesh.load_mesh(file, process=False) for file in files)
            return Cut(pieces, known.fit, known.threshold, known.cut)
    return cut(source, mesh)


def _solid(
    source: ObjectSource, mesh: SurfaceMesh, pieces: Sequence[trimesh.Trimesh]
) -> tuple[Solid, float | None]:
    """The material, and the thickness of its wall if it is hollow [m]."""
    if not mesh.closed:
        return solid_of_pieces(pieces), None
    if mesh.wall is not None or source.wall_thickness is None:
        return solid_of_surface(mesh.surface), mesh.wall
    return solid_of_shell(mesh.surface, source.wall_thickness), source.wall_thickness


def _support(contact: ContactGeometry, pieces: PieceMeshes) -> Array:
    """(N, 3) points of O whose hull rests on a plane [m]."""
    if contact.primitive is not None:
        return np.asarray(primitive_mesh(contact.primitive).vertices)
    return np.vstack([piece.vertices for piece in pieces])


def _confirmed(
    source: ObjectSource, geometry: Geometry, folder: Path, search: SymmetrySearch
) -> tuple[tuple[StablePose, ...], tuple[str, ...]]:
    """The poses that stand the test of simulation, and remarks on the others.

    The object's own mass and friction do not enter: the test sets its own.
    """
    from burg_drake.simulation.settling import confirm_poses  # imports Drake

    properties = mass_properties(geometry.solid, center_of_mass=source.center_of_mass)
    name = source.name
    sdf = model_sdf(
        name, properties, DEFAULT_FRICTION, MESH_FILE, geometry.pieces, geometry.contact
    )
    atomic_write(folder / f"{name}.sdf", sdf)
    entry = ObjectEntry(
        mesh=f"{name}/{MESH_FILE}",
        sdf=f"{name}/{name}.sdf",
        pieces=tuple(f"{name}/{piece}" for piece in geometry.pieces),
        contact=placed_contact(geometry.contact, name),
        lower=geometry.lower,
        upper=geometry.upper,
        mass_properties=properties,
        stable_poses=geometry.stable_poses,
        source=Source(file="", sha256=""),
        build="",
    )
    document = LibraryDocument(name="resting", objects={name: entry})
    confirmation = confirm_poses(ObjectLibrary(document, folder.parent), name, search)
    return confirmation.poses, confirmation.notes


def placed_contact(contact: ContactGeometry, name: str) -> ContactGeometry:
    """The contact geometry of object `name` with its mesh relative to the library's folder."""
    return replace(contact, mesh=f"{name}/{contact.mesh}") if contact.mesh else contact


def _vector(values: Any) -> Vector3:
    return cast(Vector3, tuple(np.asarray(values, dtype=float).tolist()))


@contextmanager
def _timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    start = time.thread_time()
    yield
    seconds[stage] = time.thread_time() - start
