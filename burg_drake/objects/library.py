"""Object libraries: the document, its entries, and the files that it refers to."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal, get_args

import numpy as np

from burg_drake.core import (
    NO_PACKAGES,
    Array,
    DocumentError,
    InvalidInputError,
    MeshError,
    Pose,
    Ranges,
    UnknownNameError,
    Vector3,
    atomic_write,
    content_hash,
    load_document,
    may_reference_packages,
    referenced_files,
    require_name,
    require_names,
    require_ranges,
    resolve_reference,
    save_document,
    suggest_names,
)

if TYPE_CHECKING:
    import trimesh

DEFAULT_FRICTION = 0.24
"""Friction coefficient, as in BURG-Toolkit (Rudorfer et al., 2022)."""

UPRIGHT_TOLERANCE = math.radians(10.0)
"""Radians; a stable pose within this angle of the mesh's orientation counts as the mesh's pose."""

Inertia = tuple[float, float, float, float, float, float]
"""Ixx, Iyy, Izz, Ixy, Ixz, Iyz [kg m^2]."""

ContactKind = Literal["surface", "pieces", "compliant_pieces", "mesh", "primitive"]
CONTACT_KINDS: tuple[ContactKind, ...] = get_args(ContactKind)
"""Names of the kinds of contact geometry."""

PRIMITIVE_SIZES = {"box": 3, "cylinder": 2, "sphere": 1}
"""Number of lengths of each primitive."""


@dataclass(frozen=True, kw_only=True)
class StablePose:
    """A pose in which an object can stand on a plane.

    Attributes:
        probability: share of drops from random orientations that end in this pose, 0 to 1.
        X_SO: pose of the object in a frame whose xy plane is the support, with the origin below the
            centre of mass.
        residual: largest angle by which the object came to rest tilted from this pose in simulation
            [rad], up to its symmetry; left out if it was not simulated.
        rolls: whether the object can roll and stay in this pose, as a lying can.
    """

    probability: float
    X_SO: Pose
    residual: float | None = None
    rolls: bool = False


@dataclass(frozen=True, kw_only=True)
class MassProperties:
    """Mass, centre of mass and inertia of an object, in its frame O.

    Attributes:
        mass: mass [kg].
        source: where the mass is from: `given`, or computed with a `density`. `fixed` is for
            objects without a mass, which can only be background.
        volume: volume of the material [m^3]; of the wall alone if the object is hollow.
        center_of_mass: centre of mass in O [m].
        inertia: Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the centre of mass, in the axes of O [kg m^2].
        wall_thickness: thickness of the wall of a hollow object [m]; left out for a solid one.
        overridden: values that were given and not computed.
    """

    mass: float
    source: Literal["given", "density", "fixed"]
    volume: float
    center_of_mass: Vector3
    inertia: Inertia
    wall_thickness: float | None = None
    overridden: tuple[Literal["center_of_mass", "inertia"], ...] = ()

    def __post_init__(self) -> None:
        if self.mass <= 0.0:
            raise InvalidInputError(f"mass is {self.mass:g} kg; a free object needs a mass above 0")


@dataclass(frozen=True, kw_only=True)
class Decomposition:
    """Parameters of the convex decomposition.

    Attributes:
        threshold: concavity at which CoACD stops cutting, for an object scaled to unit size.
        join: volume that joining two pieces may add, as a share of the volume of all pieces.
        max_vertices: largest number of vertices of a piece.
        tolerance: distance within which a piece follows its full convex hull, if `max_vertices`
            allows it [m].
        min_thickness: thinner pieces are dropped [m].
        timeout: CPU time for CoACD [s].
        seed: seed of CoACD's search.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True

    RANGES: ClassVar[Ranges] = {
        "threshold": (0.01, 1.0),
        "join": (0.0, 10.0),
        "max_vertices": (4, 4096),
        "tolerance": (0.0, 0.1),
        "min_thickness": (0.0, 0.1),
        "timeout": (1e-3, 86400.0),
        "seed": (0, 2**31 - 1),
    }
    """Values that make sense; CoACD itself takes thresholds of 0.01 to 1."""

    threshold: float = 0.05
    join: float = 0.01
    max_vertices: int = 64
    tolerance: float = 2e-4
    min_thickness: float = 2e-4
    timeout: float = 300.0
    seed: int = 0

    def __post_init__(self) -> None:
        require_ranges(self)


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Fit of convex pieces, a primitive or another mesh to an object's surface.

    Attributes:
        volume_ratio: volume of the shape divided by the volume inside the surface. Overlaps of
            pieces count once.
        hausdorff: largest distance from a point of one of the two surfaces to the other [m].
    """

    volume_ratio: float
    hausdorff: float


@dataclass(frozen=True, kw_only=True)
class Primitive:
    """A primitive that stands for an object.

    Attributes:
        shape: shape of the primitive: a box, a cylinder along z, or a sphere.
        size: lengths along x, y and z of a box; radius and length of a cylinder; radius of a sphere
            [m].
        X_OP: pose of the primitive's centre in the object frame.
    """

    shape: Literal["box", "cylinder", "sphere"]
    size: tuple[float, ...]
    X_OP: Pose = Pose()

    def __post_init__(self) -> None:
        expected = PRIMITIVE_SIZES[self.shape]
        if len(self.size) != expected:
            raise InvalidInputError(
                f"size of a {self.shape} has {len(self.size)} entries; expected {expected}"
            )
        if min(self.size) <= 0.0:
            raise InvalidInputError(
                f"size of a {self.shape} is {list(self.size)}; it must be above 0"
            )


@dataclass(frozen=True, kw_only=True)
class ContactGeometry:
    """What touches other things in simulation.

    Attributes:
        kind: what touches other things. `surface`: gripper pads meet the surface, all else the
            convex pieces. `pieces`: rigid convex pieces. `compliant_pieces`: convex pieces that
            yield. `mesh`: the surface, for all. `primitive`: a box, cylinder or sphere.
        fit: fit of this geometry to the object's surface; left out for pieces, whose fit is beside
            `pieces`.
        mesh: mesh of the kinds `surface` and `mesh` (.obj).
        primitive: the primitive of the kind `primitive`.
        excess: largest distance by which the surface stands out of the convex pieces, with the kind
            `surface` [m]. Fingers that are farther from the pieces do not touch the surface.
        reason: why pads meet the convex pieces, if neither a primitive nor the surface can be used;
            else empty.
    """

    kind: ContactKind = "pieces"
    fit: Fit | None = None
    mesh: str = ""
    primitive: Primitive | None = None
    excess: float = 0.0
    reason: str = ""


@dataclass(frozen=True, kw_only=True)
class Source:
    """Where an object is from.

    Attributes:
        file: name of the mesh file; empty for a mesh made in memory.
        path: path of the mesh file, relative to the library's folder.
        sha256: SHA-256 of the mesh file, or of the mesh's arrays.
        scale: factor from the file's unit to metres.
        repairs: repairs of the mesh, one sentence each.
    """

    file: str
    path: str = ""
    sha256: str
    scale: float = 1.0
    repairs: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class ObjectEntry:
    """One object of a library. Paths are relative to the library's folder.

    Attributes:
        description: text for people.
        mesh: mesh to look at, in metres, in the object frame O (.obj).
        surface: surface that the object was built from (.obj), if that is not `mesh`: that of a
            textured mesh made into a wall, for example.
        sdf: model for Drake (SDFormat), with one link `body` whose frame is O.
        pieces: convex pieces (.obj).
        decomposition: how the pieces were cut; left out for pieces that were given.
        fit: fit of the convex pieces to the surface; left out if it was not measured.
        contact: what touches other things in simulation.
        friction: friction coefficient. Between object and gripper pads it holds as it is. Between
            two objects, or object and table, with coefficients a and b, Drake takes 2ab / (a + b).
        lower: lower corner of the bounding box along the axes of O [m].
        upper: upper corner of the bounding box along the axes of O [m].
        mass_properties: mass, centre of mass and inertia.
        stable_poses: poses in which the object can stand, the most probable first.
        source: mesh file that the object was built from, and its repairs.
        build: hash of all that was given to build the object: mesh and textures, mass, density,
            friction, scale, pieces, colour, name and parameters of the decomposition. It includes
            the versions of the pipeline and, unless pieces were given, of CoACD.
    """

    description: str = ""
    mesh: str
    surface: str = ""
    sdf: str
    pieces: tuple[str, ...]
    decomposition: Decomposition | None = None
    fit: Fit | None = None
    contact: ContactGeometry = ContactGeometry()
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

    @property
    def is_fixed(self) -> bool:
        """Whether the object has no mass, so that it can only be background of a scene."""
        return self.mass_properties.source == "fixed"

    @property
    def files(self) -> tuple[str, ...]:
        """All files of the entry, relative to the library's folder."""
        files = (self.mesh, self.surface, self.sdf, *self.pieces, self.contact.mesh)
        return tuple(file for file in files if file)

    @property
    def proposed_pose(self) -> int:
        """Number of the stable pose with the orientation of the mesh, as most scans have it; 0, the
        most probable pose, if there is none."""
        up = [float(pose.X_SO.matrix()[2, 2]) for pose in self.stable_poses]
        if not up or max(up) < math.cos(UPRIGHT_TOLERANCE):
            return 0
        return up.index(max(up))

    def X_SO(self, stable_pose: int = 0) -> Array:
        """(4, 4) pose of the object in its k-th stable pose, centre of mass above the origin of
        S."""
        if not 0 <= stable_pose < len(self.stable_poses):
            raise InvalidInputError(
                f"stable pose {stable_pose} does not exist; give 0 to {len(self.stable_poses) - 1}"
            )
        return self.stable_poses[stable_pose].X_SO.matrix()


LIBRARY_FILE = "library.yaml"  # File name of the library document.


@dataclass(frozen=True, kw_only=True)
class LibraryDocument:
    """An object library (`library.yaml`), written by `burg-drake library build`.

    Attributes:
        name: name of the library.
        description: text for people.
        objects: the objects by name.
    """

    version: int = 1
    name: str
    description: str = ""
    objects: dict[str, ObjectEntry] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require_name(self.name, "name")
        require_names(self.objects, "objects")


@dataclass(frozen=True)
class ObjectLibrary:
    """A library on disk.

    Attributes:
        document: contents of `library.yaml`.
        root: the library's folder.
    """

    document: LibraryDocument
    root: Path

    def __repr__(self) -> str:
        return f"ObjectLibrary({self.name!r}, {len(self.objects)} objects, {str(self.root)!r})"

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
                f"object {name!r} is not in library {self.root};"
                f" {suggest_names(name, self.objects)}"
            )
        return self.objects[name]

    def path(self, relative: str) -> Path:
        """Absolute path of a file of the library.

        Raises:
            UnknownNameError: the file is missing.
        """
        path = self.root / relative
        if not path.is_file():
            what = "is missing" if not path.exists() else "is not a file"
            raise UnknownNameError(f"{path} {what}; build library {self.name!r} again")
        return path

    def surface(self, name: str) -> trimesh.Trimesh:
        """The surface of an object, to sample on and measure.

        Args:
            name: name of the object.

        Returns:
            The object's mesh in the object frame O [m], without colours. Vertices that the file
            repeats for different normals or texture coordinates are merged.

        Raises:
            UnknownNameError: no such object, or its mesh file is missing.
            MeshError: the mesh file is damaged.
        """
        entry = self.entry(name)
        return self._read(entry.surface or entry.mesh, merge=True)

    def mesh(self, relative: str) -> trimesh.Trimesh:
        """A mesh file of the library, such as a convex piece, unchanged but without colours [m].

        Raises:
            UnknownNameError: the file is missing.
            MeshError: the file is damaged.
        """
        return self._read(relative, merge=False)

    def _read(self, relative: str, *, merge: bool) -> trimesh.Trimesh:
        """A mesh file, with vertices at the same place merged if asked for."""
        path = self.path(relative)
        state = path.stat()
        try:
            found = _read_mesh(path, state.st_mtime_ns, state.st_size, merge=merge)
        except Exception as error:  # the reader raises errors of any type
            raise self.damaged(path) from error
        return found.copy(include_cache=True)

    def damaged(self, path: Path) -> MeshError:
        """The error for a damaged mesh file."""
        return MeshError(f"{path} is damaged or not a mesh; build library {self.name!r} again")

    @cached_property
    def content(self) -> dict[str, str]:
        """Build hashes by object name; they include the package files that an object's model refers
        to."""
        return {name: self._content(entry) for name, entry in self.objects.items()}

    def _content(self, entry: ObjectEntry) -> str:
        model = self.root / entry.sdf
        if not model.is_file() or not may_reference_packages(model):
            return entry.build
        return content_hash(entry.build, referenced_files(model, NO_PACKAGES))

    def save(self) -> None:
        """Writes `library.yaml`, and the `package.xml` that makes the folder a package for Drake's
        Parser and ROS: `package://NAME/mug/mug.sdf`."""
        manifest = self.root / "package.xml"
        package = package_manifest(package_name(self.name), "Object library")
        if not manifest.is_file() or manifest.read_text() != package:
            atomic_write(manifest, package)
        save_document(self.document, self.root / LIBRARY_FILE)


@lru_cache(maxsize=64)
def _read_mesh(path: Path, modified: int, size: int, *, merge: bool) -> trimesh.Trimesh:
    """Reads a mesh file; files are read again once they have changed.

    Args:
        path: the file.
        modified, size: time of its last change, and its size.
        merge: whether to merge vertices at the same place.

    Raises:
        Exception: errors of any type by the reader; the file has no faces, or one beyond its
            vertices, or a vertex is not finite.
    """
    import trimesh

    mesh = trimesh.load(path, force="mesh", process=False, skip_materials=True)
    corners = np.asarray(mesh.vertices)[mesh.faces]
    if not len(corners) or not np.isfinite(corners).all():
        raise ValueError(f"{path} has no faces, or vertices that are not finite")
    if merge:
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
    return mesh


def load_library(reference: str | Path, base: Path | None = None) -> ObjectLibrary:
    """Loads a library.

    Example::

        library = burg.load_library("household")
        mug = library.entry("mug")
        print(mug.mass, [pose.probability for pose in mug.stable_poses])

    Args:
        reference: the library's folder or its `library.yaml`; a bare name such as `household` for
            a built-in one; or `package://burg_drake/models/...`.
        base: folder that relative references start from.

    Raises:
        UnknownNameError: there is no such library.
        DocumentError: its document does not fit the schema.
    """
    path = resolve_reference(reference, "models", base)
    file = path / LIBRARY_FILE if path.is_dir() else path
    if file is not path and not file.exists():
        raise DocumentError(
            f"{path} is not an object library ({LIBRARY_FILE} is missing); `burg-drake"
            " library build` makes a library from meshes"
        )
    return ObjectLibrary(load_document(file, LibraryDocument), file.parent)


LibraryLike = ObjectLibrary | str | Path
"""A loaded library, or an argument of `load_library`: a path, or the name of a built-in library."""


def as_library(library: LibraryLike) -> ObjectLibrary:
    """Returns a library, loaded if it is given by name.

    Raises:
        UnknownNameError, DocumentError: see `load_library`.
    """
    return library if isinstance(library, ObjectLibrary) else load_library(library)


def package_name(name: str) -> str:
    """Makes a package name that is valid in ROS and Drake from a document's name."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "library"


def package_manifest(package: str, description: str) -> str:
    """A minimal ROS package manifest (format 3, REP 149)."""
    return f"""<?xml version="1.0"?>
<package format="3">
  <name>{package}</name>
  <version>1.0.0</version>
  <description>{description}</description>
  <maintainer email="nobody@example.com">nobody</maintainer>
  <license>unknown</license>
</package>
"""
