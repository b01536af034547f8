"""The object library document: what is known of each object, and where its files are.

A library is a folder with a `library.yaml` and one folder an object; all paths in the document are
relative to the library's folder, so that it can be moved or zipped as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from burg_drake.core.errors import InvalidInputError, UnknownNameError, nearest
from burg_drake.core.frames import Array
from burg_drake.core.resources import resolve
from burg_drake.core.schema import Pose, Vector3, load_document, save_document

if TYPE_CHECKING:
    import trimesh

DEFAULT_FRICTION = 0.24
"""Friction coefficient where none is given, as in BURG-Toolkit (Rudorfer et al., 2022)."""

LIBRARY_FILE = "library.yaml"


@dataclass(frozen=True, kw_only=True)
class StablePose:
    """A way to rest on a horizontal plane.

    Attributes:
        probability: share of drops from random orientations that end here, in [0, 1].
        X_SO: object in a frame whose xy plane is the support; the centre of mass is above the
            frame's origin.
    """

    probability: float
    X_SO: Pose


@dataclass(frozen=True, kw_only=True)
class MassProperties:
    """Mass properties, expressed in the object frame O.

    Attributes:
        mass: [kg].
        source: `given` by the user, or computed from volume and `density`.
        volume: volume of the solid that the mass properties were computed with [m^3].
        center_of_mass: `p_OOcm` [m].
        inertia: moments and products about the centre of mass in the axes of O:
            Ixx, Iyy, Izz, Ixy, Ixz, Iyz [kg m^2].
    """

    mass: float
    source: Literal["given", "density"]
    volume: float
    center_of_mass: Vector3
    inertia: tuple[float, float, float, float, float, float]

    def __post_init__(self) -> None:
        if self.mass <= 0.0:
            raise InvalidInputError(f"mass is {self.mass:g} kg; a free object needs a mass above 0")


@dataclass(frozen=True, kw_only=True)
class Source:
    """Where an object came from.

    Attributes:
        file: name of the mesh file it was built from; empty for a mesh in memory.
        sha256: hash of that file's bytes, or of the mesh's arrays.
        scale: factor from the file's unit to metres.
        repairs: what was changed in the mesh, one sentence each.
    """

    file: str
    sha256: str
    scale: float = 1.0
    repairs: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class ObjectEntry:
    """One object of a library; paths are relative to the library's folder.

    Attributes:
        description: for people.
        mesh: surface mesh in metres, in the object frame O (.obj).
        sdf: the Drake model; one link `body` whose frame is O.
        pieces: convex collision pieces (.obj).
        friction: coefficient. In a trial, that between the object and the gripper's pads, as they
            take the target's. Against the table and other objects Drake combines the coefficients
            a and b of the two to 2ab / (a + b).
        lower, upper: corners of the axis-aligned bounding box in O [m].
        mass_properties: mass, centre of mass, inertia.
        stable_poses: most probable first.
        source: the mesh file and its repairs.
        build: hash of everything that was given (the mesh with its textures, mass, density,
            friction, scale, pieces, colour, name, parameters of the decomposition), of the
            pipeline's version and defaults, and of CoACD's version unless pieces were given;
            not of the files that came out.
    """

    description: str = ""
    mesh: str
    sdf: str
    pieces: tuple[str, ...]
    friction: float = DEFAULT_FRICTION
    lower: Vector3
    upper: Vector3
    mass_properties: MassProperties
    stable_poses: tuple[StablePose, ...]
    source: Source
    build: str

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return self.mass_properties.mass

    def X_SO(self, stable_pose: int = 0) -> Array:
        """(4, 4) object in its k-th stable pose, centre of mass above the origin of S."""
        if not 0 <= stable_pose < len(self.stable_poses):
            raise InvalidInputError(
                f"stable pose {stable_pose} does not exist; give 0 to {len(self.stable_poses) - 1}"
            )
        return self.stable_poses[stable_pose].X_SO.matrix()


@dataclass(frozen=True, kw_only=True)
class LibraryDocument:
    """Schema of `library.yaml`."""

    version: int = 1
    name: str
    description: str = ""
    objects: dict[str, ObjectEntry] = field(default_factory=dict)


@dataclass(frozen=True)
class ObjectLibrary:
    """A library on disk.

    Attributes:
        document: contents of `library.yaml`.
        root: the library's folder.
    """

    document: LibraryDocument
    root: Path

    @property
    def name(self) -> str:
        """The library's name."""
        return self.document.name

    @property
    def objects(self) -> dict[str, ObjectEntry]:
        """Entries by object name."""
        return self.document.objects

    def entry(self, name: str) -> ObjectEntry:
        """The entry of an object.

        Raises:
            UnknownNameError: no such object; the message lists the nearest and all names.
        """
        if name not in self.objects:
            raise UnknownNameError(
                f"object {name!r} is not in library {self.root}; {nearest(name, self.objects)}"
            )
        return self.objects[name]

    def path(self, relative: str) -> Path:
        """Absolute path of a file of the library.

        Raises:
            UnknownNameError: the file is missing.
        """
        path = self.root / relative
        if not path.exists():
            raise UnknownNameError(f"{path} is missing; build the library {self.name!r} again")
        return path

    def surface(self, name: str) -> trimesh.Trimesh:
        """The surface of an object, to sample on and measure.

        Args:
            name: of the object.

        Returns:
            Its mesh in the object frame O [m], without colours; vertices that the file repeats for
            their normals and texture coordinates are merged.

        Raises:
            UnknownNameError: no such object, or its mesh file is missing.
        """
        import trimesh

        path = self.path(self.entry(name).mesh)
        mesh = trimesh.load(path, force="mesh", process=False, skip_materials=True)
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
        return mesh

    @cached_property
    def content(self) -> dict[str, str]:
        """Build hash by object name."""
        return {name: entry.build for name, entry in self.objects.items()}

    def save(self) -> None:
        """Writes `library.yaml`."""
        save_document(self.document, self.root / LIBRARY_FILE)


def load_library(reference: str | Path, base: Path | None = None) -> ObjectLibrary:
    """Loads a library.

    Args:
        reference: the library's folder or its `library.yaml`; a bare name such as `household` for
            a built-in one; or `package://burg_drake/models/...`.
        base: folder that relative references start from.

    Raises:
        UnknownNameError: there is no such library.
        DocumentError: its document does not fit the schema.
    """
    path = resolve(reference, "models", base)
    file = path / LIBRARY_FILE if path.is_dir() else path
    return ObjectLibrary(load_document(file, LibraryDocument), file.parent)
