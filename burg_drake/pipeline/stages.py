"""The stages of one object's build; each runs only when what it is made from has changed."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import trimesh

from burg_drake.core.files import atomic_write
from burg_drake.core.paths import MESH_FILE
from burg_drake.objects.collision import deviation_warning, pieces_instead
from burg_drake.objects.library import (
    Decomposition,
    MassProperties,
    ObjectEntry,
    Source,
    StablePose,
    model_sdf,
)
from burg_drake.objects.meshes import missing_textures
from burg_drake.objects.physics import DEFAULT_DENSITY, implausible, mass_properties
from burg_drake.pipeline.geometry import build_geometry, placed_contact
from burg_drake.pipeline.keys import StageKeys
from burg_drake.pipeline.record import (
    Geometry,
    Record,
    entry_hash,
    file_hashes,
    intact,
    is_as_built,
    read_record,
    touched_by_pieces,
    write_record,
)
from burg_drake.pipeline.source import ObjectSource


@dataclass(frozen=True)
class Built:
    """A built or updated object.

    Attributes:
        folder: where its files are, to be moved into the library; None if they are in place.
        entry: for the library.
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
    """Whether the library holds just what these keys and the source ask for."""
    return (
        entry.build == keys.build
        and entry.description == source.description
        and (entry.source.file, entry.source.path) == _origin(source, root)
        and not (confirm and _unconfirmed(entry.stable_poses))
        and is_as_built(root / source.name, keys, entry)
    )


def _unconfirmed(poses: Sequence[StablePose]) -> bool:
    """Whether the simulation of poses failed, so that it is worth another try."""
    return any(pose.residual is None for pose in poses)


def build_object(
    source: ObjectSource, keys: StageKeys, root: Path, scratch: Path, confirm: bool = True
) -> Built:
    """Builds an object, or what of it has changed.

    Args:
        source: what to build.
        keys: its stage keys.
        root: the library's folder; files in the object's folder are used again where they can.
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
        and not (confirm and _unconfirmed(before.geometry.stable_poses))
        and intact(home, before, (name for name in before.files if not name.endswith(".sdf")))
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
    entry = _entry(source, keys, geometry, properties, root)
    target = home if folder is None else folder
    files = file_hashes(target) | {f"{source.name}.sdf": hashlib.sha256(sdf.encode()).hexdigest()}
    record = Record(keys=keys, geometry=geometry, files=files, entry=entry_hash(entry))
    # The record goes first: after a kill in between, it matches no SDF, and the object is built
    # again.
    write_record(target, record)
    atomic_write(target / f"{source.name}.sdf", sdf)
    notes = _notes(source, geometry, properties)
    if had_pieces and geometry.contact.kind == "surface":
        notes.append("built again: finger pads now touch the object's own surface")
    return Built(folder, entry, tuple(notes), seconds)


def _notes(source: ObjectSource, geometry: Geometry, properties: MassProperties) -> list[str]:
    """What the user should know of a built object."""
    notes = []
    if source.mass is None and not source.fixed:
        used = DEFAULT_DENSITY if source.density is None else source.density
        why = "no mass or density given" if source.density is None else "no mass given"
        notes.append(f"{why}: computed {properties.mass:.4g} kg from volume and {used:g} kg/m^3")
    if not geometry.closed:
        notes.append("the mesh is not closed; its volume is that of the convex pieces")
    if not isinstance(source.mesh, trimesh.Trimesh):
        notes += missing_textures(Path(source.mesh))
    notes += implausible(properties, geometry.lower, geometry.upper)
    diagonal = float(np.linalg.norm(np.subtract(geometry.upper, geometry.lower)))
    notes.append(pieces_instead(geometry.contact, len(geometry.pieces)))
    coarse = deviation_warning(geometry.fit, diagonal, geometry.threshold)
    notes += [geometry.cut, coarse, *geometry.notes]
    return [note for note in notes if note]


def _origin(source: ObjectSource, root: Path) -> tuple[str, str]:
    """Name of the mesh file, and where it is seen from the library; empty for a mesh in memory."""
    if isinstance(source.mesh, trimesh.Trimesh):
        return "", ""
    mesh = Path(source.mesh)
    known = os.path.relpath(os.path.realpath(mesh), os.path.realpath(root))
    return mesh.name, Path(known).as_posix()


def _entry(
    source: ObjectSource,
    keys: StageKeys,
    geometry: Geometry,
    properties: MassProperties,
    root: Path,
) -> ObjectEntry:
    file, path = _origin(source, root)
    return ObjectEntry(
        description=source.description,
        mesh=f"{source.name}/{MESH_FILE}",
        surface=f"{source.name}/{geometry.surface}" if geometry.surface else "",
        sdf=f"{source.name}/{source.name}.sdf",
        pieces=tuple(f"{source.name}/{name}" for name in geometry.pieces),
        decomposition=_decomposition(source, geometry),
        fit=geometry.fit,
        contact=placed_contact(geometry.contact, source.name),
        friction=source.coefficient,
        lower=geometry.lower,
        upper=geometry.upper,
        mass_properties=properties,
        stable_poses=geometry.stable_poses,
        source=Source(
            file=file, path=path, sha256=keys.file, scale=source.scale, repairs=geometry.repairs
        ),
        build=keys.build,
    )


def _decomposition(source: ObjectSource, geometry: Geometry) -> Decomposition | None:
    """The parameters that the pieces were cut with, if they were."""
    if source.pieces is not None:
        return None
    return replace(
        source.decomposition, threshold=geometry.threshold or source.decomposition.threshold
    )
