"""Sources of objects: a mesh, and the properties that a mesh does not have."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import trimesh

from burg_drake.core import InvalidInputError, Rgba, Vector3, content_hash, quote_value
from burg_drake.objects import (
    DEFAULT_FRICTION,
    ContactKind,
    Decomposition,
    Inertia,
    Openings,
    read_piece,
)

OBJECT_NAME_PATTERN = re.compile(r"[a-z0-9][a-z0-9_]*")


@dataclass(frozen=True, kw_only=True, eq=False)
class ObjectSource:
    """An object to build.

    Example::

        mug = burg.ObjectSource.from_file("mug.obj", mass=0.3, friction=0.5)
        crate = burg.ObjectSource.from_file("crate.stl", scale=0.001, fixed=True)  # millimetres
        burg.build_library([mug, crate], "my_library")

    Attributes:
        name: name of the library entry: lower-case letters, digits and underscores.
        mesh: mesh file, or a mesh in memory.
        mass: mass [kg]; computed from the density if None.
        density: density of the material [kg/m^3]; `DEFAULT_DENSITY` if None.
        fixed: the object has no mass and can only be background of a scene, such as furniture.
        center_of_mass: centre of mass `p_OOcm` [m], in place of the centroid.
        inertia: Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the centre of mass in the axes of O [kg m^2], in
            place of the inertia of uniform density.
        wall_thickness: thickness of the wall [m]. A closed surface becomes a hollow body with all
            mass in its wall; an open surface becomes a wall of this thickness (`Preparation` has
            the default).
        openings: how to close an open surface: as a `wall`, or with flat caps (`close`).
        friction: friction coefficient; `DEFAULT_FRICTION` if None.
        scale: factor from the mesh's unit to metres.
        pieces: convex pieces, meshes in O [m] or mesh files in the mesh's own frame and unit; made
            by decomposition if None.
        contact: kind of contact geometry in simulation; chosen by the object's shape if None.
        rgba: colour, 0 to 1 each; by default that of the mesh file.
        description: text for people.
        decomposition: parameters of the convex decomposition.
    """

    name: str
    mesh: str | Path | trimesh.Trimesh
    mass: float | None = None
    density: float | None = None
    fixed: bool = False
    center_of_mass: Vector3 | None = None
    inertia: Inertia | None = None
    wall_thickness: float | None = None
    openings: Openings = "wall"
    friction: float | None = None
    scale: float = 1.0
    pieces: tuple[trimesh.Trimesh | Path, ...] | None = None
    contact: ContactKind | None = None
    rgba: Rgba | None = None
    description: str = ""
    decomposition: Decomposition = Decomposition()

    @classmethod
    def from_file(cls, mesh: str | Path, **fields: Any) -> ObjectSource:
        """Makes a source from a mesh file such as `003_cracker_box.obj`. The object is named after
        the file, or by its hash if the file name has no letters a-z or digits.

        Args:
            mesh: mesh file.
            fields: other attributes.
        """
        stem = Path(mesh).stem
        try:
            name = object_name(stem)
        except InvalidInputError:
            name = f"mesh_{content_hash(stem)[:6]}"
        return cls(name=name, mesh=Path(mesh), **fields)

    @property
    def coefficient(self) -> float:
        """The friction coefficient that the object gets."""
        return DEFAULT_FRICTION if self.friction is None else self.friction


def object_name(text: str) -> str:
    """Makes a valid object name: `Bleach Cleanser (2)` becomes `bleach_cleanser_2`.

    Raises:
        InvalidInputError: the text has no letters or digits.
    """
    name = re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")
    if not name:
        raise InvalidInputError(
            f"{quote_value(text)} gives no object name; use letters or digits a-z, 0-9"
        )
    return name


def piece_meshes(source: ObjectSource) -> tuple[trimesh.Trimesh, ...] | None:
    """Reads the convex pieces that come with an object, in O [m]; None if there are none.

    Raises:
        MeshError: a file cannot be read.
    """
    if source.pieces is None:
        return None
    return tuple(
        piece if isinstance(piece, trimesh.Trimesh) else read_piece(piece, source.scale)
        for piece in source.pieces
    )


def check_source(source: ObjectSource) -> None:
    """Checks the numbers that come with a mesh.

    Raises:
        InvalidInputError: a name, mass, density, friction or colour is invalid.
    """
    if not OBJECT_NAME_PATTERN.fullmatch(source.name):
        raise InvalidInputError(
            f"{source.name!r} is not a valid object name; use a-z, 0-9 and underscores,"
            f" such as {object_name(source.name + '_0').removesuffix('_0') or 'mug'!r}"
        )
    try:
        check_numbers(source)
    except InvalidInputError as error:
        raise InvalidInputError(f"{source.name}: {error}") from error


def check_numbers(given: Any) -> None:
    """Checks the numbers of an object, or the defaults of several.

    Args:
        given: object with some or all attributes of `ObjectSource`.

    Raises:
        InvalidInputError: a mass, density, wall thickness, scale, friction or colour is invalid.
    """
    for label, unit in (
        ("mass", " kg"),
        ("density", " kg/m^3"),
        ("wall_thickness", " m"),
        ("scale", ""),
    ):
        value = getattr(given, label, None)
        if value is not None and not 0.0 < value < float("inf"):
            hint = " (leave it out to use a density)" if label == "mass" else ""
            raise InvalidInputError(f"{label} is {value:g}{unit}; it must be above 0{hint}")
    if given.friction is not None and not 0.0 <= given.friction < float("inf"):
        raise InvalidInputError(f"friction is {given.friction:g}; it must be at least 0")
    if given.rgba is not None and not all(0.0 <= c <= 1.0 for c in given.rgba):
        raise InvalidInputError(f"rgba is {list(given.rgba)}; each number must be from 0 to 1")
