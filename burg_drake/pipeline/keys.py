"""Content hashes that tell which stages of an object's build have to run again."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path

import numpy as np
import trimesh

from burg_drake.core import content_hash
from burg_drake.objects.library import DEFAULT_CONTACT
from burg_drake.objects.meshes import mesh_hash
from burg_drake.objects.physics import DEFAULT_DENSITY
from burg_drake.pipeline.cutting import FINER, MOST_PIECES
from burg_drake.pipeline.source import ObjectSource, check_source, piece_meshes

VERSION = 3
"""Raise it when a stage gives other results for the same input; everything is then built anew."""

POSES_VERSION = 2
"""Raise it when only the stable poses come out otherwise: geometry is then built again from the
same pieces. It is no part of `build`, which seeds the sampling of grasps on the same surface."""


@dataclass(frozen=True)
class StageKeys:
    """Content hashes of what each stage is made from.

    Attributes:
        file: SHA-256 of the mesh file's bytes; of the arrays for a mesh in memory.
        mesh: hash of the mesh with all that its file refers to.
        visual: the visual mesh.
        pieces: the surface, its convex pieces, and how well they fit.
        rest: what touches, the volume, the centre of mass, and the stable poses.
        build: everything, `ObjectEntry.build`.
    """

    file: str
    mesh: str
    visual: str
    pieces: str
    rest: str
    build: str


def stage_keys(source: ObjectSource, confirm: bool) -> StageKeys:
    """Keys of all stages; reads the mesh file's bytes, but builds nothing.

    Args:
        source: what to build.
        confirm: whether stable poses are simulated.

    Raises:
        MeshError: the mesh file cannot be read.
        InvalidInputError: a number of the source cannot be.
    """
    check_source(source)
    mesh = mesh_hash(source.mesh)
    given = None
    pieces_given = piece_meshes(source)
    if pieces_given is not None:
        given = [(np.asarray(p.vertices), np.asarray(p.faces)) for p in pieces_given]
    thickness = None if source.wall_thickness is None else float(source.wall_thickness)
    makers = (_release("trimesh"), _release("manifold3d"))
    surface = (mesh, float(source.scale), thickness, source.openings, *makers)
    visual = content_hash(VERSION, "opaque visual", *surface, _floats(source.rgba))
    maker = [_release("coacd"), *FINER, MOST_PIECES] if given is None else []
    pieces = content_hash(VERSION, "pieces", *surface, given, asdict(source.decomposition), *maker)
    rest = content_hash(
        VERSION,
        "rest",
        pieces,
        _floats(source.center_of_mass),
        source.contact,
        asdict(DEFAULT_CONTACT),
        [_release("drake")] if confirm else None,
    )
    numbers = (source.mass, source.density, source.coefficient)
    build = content_hash(
        VERSION,
        visual,
        rest,
        source.name,
        _floats(numbers),
        _floats(source.inertia),
        DEFAULT_DENSITY,
        asdict(DEFAULT_CONTACT),
        *(["fixed"] if source.fixed else []),
    )
    in_memory = isinstance(source.mesh, trimesh.Trimesh)
    rest = content_hash(rest, POSES_VERSION)
    file = mesh if in_memory else hashlib.sha256(Path(source.mesh).read_bytes()).hexdigest()
    return StageKeys(file, mesh, visual, pieces, rest, build)


def _floats(numbers: tuple[float | None, ...] | None) -> list[float | None] | None:
    """Numbers as floats, so that 1 and 1.0 are the same."""
    return None if numbers is None else [None if n is None else float(n) for n in numbers]


def _release(package: str) -> str:
    """Its version: another one may make something else of the same mesh."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""
