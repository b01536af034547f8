"""What is known of one object: the entry of a library."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

from burg_drake.core import Array, InvalidInputError
from burg_drake.core.documents import Pose, Vector3, require_ranges

DEFAULT_FRICTION = 0.24
"""Friction coefficient where none is given, as in BURG-Toolkit (Rudorfer et al., 2022)."""

UPRIGHT_TOLERANCE = math.radians(10.0)
"""An object that can stand within this angle of its own frame stands as its mesh does [rad]."""

Inertia = tuple[float, float, float, float, float, float]
"""Ixx, Iyy, Izz, Ixy, Ixz, Iyz [kg m^2]."""

ContactKind = Literal["surface", "pieces", "compliant_pieces", "mesh", "primitive"]
CONTACT_KINDS: tuple[ContactKind, ...] = get_args(ContactKind)

PRIMITIVE_SIZES = {"box": 3, "cylinder": 2, "sphere": 1}
"""Number of lengths that a primitive has."""


@dataclass(frozen=True, kw_only=True)
class StablePose:
    """A way to rest on a horizontal plane.

    Attributes:
        probability: share of drops from random orientations that end here, in [0, 1].
        X_SO: object in a frame whose xy plane is the support; the centre of mass is above the
            frame's origin.
        residual: angle by which the simulated object ended up tilted from this pose, at most, when
            it was dropped on it with disturbances; up to its symmetry [rad]. None: not simulated.
        rolls: whether it can roll on from here and still be in the same pose, as a lying can.
    """

    probability: float
    X_SO: Pose
    residual: float | None = None
    rolls: bool = False


@dataclass(frozen=True, kw_only=True)
class MassProperties:
    """Mass properties, expressed in the object frame O.

    Attributes:
        mass: [kg].
        source: `given` by the user, or computed from volume and `density`; `fixed` is furniture
            that nobody gave a mass, which can only be background of a scene.
        volume: volume of the material that the mass properties were computed with [m^3]: of the
            wall alone where the object is hollow.
        center_of_mass: `p_OOcm` [m].
        inertia: moments and products about the centre of mass in the axes of O:
            Ixx, Iyy, Izz, Ixy, Ixz, Iyz [kg m^2].
        wall_thickness: of a hollow object [m]; None if it is solid.
        overridden: which of the others were given by the user, and not computed.
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


DECOMPOSITION_RANGES = {
    "threshold": (0.01, 1.0),
    "join": (0.0, 10.0),
    "max_vertices": (4, 4096),
    "tolerance": (0.0, 0.1),
    "min_thickness": (0.0, 0.1),
    "timeout": (1e-3, 86400.0),
    "seed": (0, 2**31 - 1),
}
"""Values that make sense; CoACD itself takes thresholds of 0.01 to 1."""


@dataclass(frozen=True, kw_only=True)
class Decomposition:
    """Parameters of the convex decomposition.

    Attributes:
        threshold: CoACD's concavity at which cutting stops, relative to a unit-sized object.
        join: volume that joining pieces may add, as a share of the pieces' volume.
        max_vertices: most vertices of a piece.
        tolerance: pieces stay within this distance of the full hull where `max_vertices`
            allows [m].
        min_thickness: thinner pieces are dropped [m].
        timeout: CPU time allowed for CoACD [s].
        seed: of CoACD's search.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True

    threshold: float = 0.05
    join: float = 0.01
    max_vertices: int = 64
    tolerance: float = 2e-4
    min_thickness: float = 2e-4
    timeout: float = 300.0
    seed: int = 0

    def __post_init__(self) -> None:
        require_ranges(self, DECOMPOSITION_RANGES)


@dataclass(frozen=True, kw_only=True)
class Fit:
    """How well a shape stands for an object's surface.

    Attributes:
        volume_ratio: volume of the shape, overlaps of its parts counted once, over the volume
            inside the surface.
        hausdorff: largest distance from a point of one surface to the other, either way [m].
    """

    volume_ratio: float
    hausdorff: float


@dataclass(frozen=True, kw_only=True)
class Primitive:
    """A primitive that stands for an object.

    Attributes:
        shape: `box`, `cylinder` (axis z) or `sphere`, with its centre at the origin of P.
        size: extents along x, y, z of a box; radius and length of a cylinder; radius of a
            sphere [m].
        X_OP: primitive in the object frame.
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
    """What of an object touches others in simulation.

    Attributes:
        kind: `surface` (gripper pads meet the surface in `mesh`, rigid, all else the convex
            pieces), `pieces` (convex pieces, rigid), `compliant_pieces` (the same with a pressure
            field), `mesh` (the surface in `mesh`, rigid, for all) or `primitive`.
        fit: how well it stands for the surface; None for pieces, see `ObjectEntry.fit`.
        mesh: the mesh of kinds `surface` and `mesh` (.obj, relative to the library's folder).
        primitive: that of kind `primitive`.
        excess: how far the surface of kind `surface` stands out of the union of the convex pieces,
            at most [m]. Fingers that are clear of the pieces by more do not touch the surface.
        reason: why pads meet the pieces, where neither a primitive nor the object's own surface
            can stand for it; else empty.
    """

    kind: ContactKind = "pieces"
    fit: Fit | None = None
    mesh: str = ""
    primitive: Primitive | None = None
    excess: float = 0.0
    reason: str = ""


@dataclass(frozen=True, kw_only=True)
class Source:
    """Where an object came from.

    Attributes:
        file: name of the mesh file it was built from; empty for a mesh in memory.
        path: where that file was, relative to the library's folder.
        sha256: hash of that file's bytes, or of the mesh's arrays.
        scale: factor from the file's unit to metres.
        repairs: what was changed in the mesh, one sentence each.
    """

    file: str
    path: str = ""
    sha256: str
    scale: float = 1.0
    repairs: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class ObjectEntry:
    """One object of a library; paths are relative to the library's folder.

    Attributes:
        description: for people.
        mesh: mesh to look at, in metres, in the object frame O (.obj).
        surface: surface that the object was built from (.obj), where that is not the one to look
            at: of a textured mesh that became a wall, for example; else empty.
        sdf: the Drake model; one link `body` whose frame is O.
        pieces: convex pieces (.obj).
        decomposition: how the pieces were cut; None for pieces that came with the object.
        fit: how well the pieces stand for the surface; None where it was not measured.
        contact: what of the object touches others in simulation.
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
        """Whether it can only be background of a scene, as it has no mass."""
        return self.mass_properties.source == "fixed"

    @property
    def files(self) -> tuple[str, ...]:
        """All files that the entry names, relative to the library's folder."""
        files = (self.mesh, self.surface, self.sdf, *self.pieces, self.contact.mesh)
        return tuple(file for file in files if file)

    @property
    def proposed_pose(self) -> int:
        """Number of the stable pose in which the object stands as its mesh does, as a scan mostly
        is; of the most probable one, 0, if it cannot stand so."""
        up = [float(pose.X_SO.matrix()[2, 2]) for pose in self.stable_poses]
        if not up or max(up) < math.cos(UPRIGHT_TOLERANCE):
            return 0
        return up.index(max(up))

    def X_SO(self, stable_pose: int = 0) -> Array:
        """(4, 4) object in its k-th stable pose, centre of mass above the origin of S."""
        if not 0 <= stable_pose < len(self.stable_poses):
            raise InvalidInputError(
                f"stable pose {stable_pose} does not exist; give 0 to {len(self.stable_poses) - 1}"
            )
        return self.stable_poses[stable_pose].X_SO.matrix()
