"""Reads the object libraries of BURG-Toolkit: `object_library.yaml`, version 1.0.

What such a file looks like was taken from what writes it, `ObjectLibrary.to_yaml` in
burg_toolkit/core.py and `YAMLObject.dump_yaml_data` in burg_toolkit/io.py
(github.com/mrudorfer/burg-toolkit), and from one that it wrote, object_library/object_library.yaml
of github.com/mrudorfer/jogramop-framework:

- `yaml_file_type: ObjectLibrary` and `yaml_file_version: '1.0'` say what it is. `objects` is a
  list, the keys of each object are sorted, what is not known is null. `scale` came later without a
  new version number: some files do not have it.
- A mass of 0, which is also what becomes of a missing one, fixes an object in space
  (`ObjectType.__init__`); here it has no mass. A friction coefficient of 0 or none becomes 0.24.
- Paths are relative to the YAML file, in the writer's spelling: with backslashes from Windows.
- `scale` belongs to the object, not to its mesh file: objects that share a mesh file differ in it,
  and mesh and convex pieces are scaled on loading (scripts/acronym/create_object_library.py;
  `save_urdf` in io.py writes it into `<mesh scale=...>`). Lengths of stable poses are therefore
  taken to be metres of the scaled object; all files seen with poses have scale 1.
- Stable poses come from the simulated fall of each pose that trimesh finds, at most ten of them,
  with the support at z = 0; near-duplicates are kept (`compute_stable_poses` in
  mesh_processing.py). Their probabilities need not add up to 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import cast

from burg_drake.core import DocumentError, InvalidInputError, check_pose
from burg_drake.core.documents import Pose, load_nodes
from burg_drake.formats.collections.burg_document import BurgReader, Matrix, relocated

FILE_TYPE = "ObjectLibrary"
FILE_VERSION = "1.0"
OTHER_FILE_HINTS = {"Scene": "give the object library that the scene names under object_library_fn"}
"""What to do about other files of BURG-Toolkit."""


@dataclass(frozen=True, kw_only=True)
class BurgStablePose:
    """A resting pose as BURG-Toolkit recorded it.

    Attributes:
        probability: as trimesh estimated it.
        X_SO: object in a frame whose xy plane is the support.
    """

    probability: float
    X_SO: Pose


@dataclass(frozen=True, kw_only=True)
class BurgObject:
    """An object type of BURG-Toolkit.

    Attributes:
        identifier: unique in its library.
        name: for people.
        mesh: the mesh file; it need not exist.
        scale: factor from the mesh file's unit to metres.
        mass: [kg]; None for an object that BURG-Toolkit fixes in space (mass 0 or absent).
        friction: coefficient; None where BURG-Toolkit uses its default of 0.24.
        stable_poses: most probable first.
        thumbnail: picture.
        urdf: model for PyBullet.
        vhacd: convex pieces, in the unit of the mesh file.
        line: where the object begins in the document.
    """

    identifier: str
    name: str
    mesh: Path
    scale: float = 1.0
    mass: float | None = None
    friction: float | None = None
    stable_poses: tuple[BurgStablePose, ...] = ()
    thumbnail: Path | None = None
    urdf: Path | None = None
    vhacd: Path | None = None
    line: int = 0


@dataclass(frozen=True, kw_only=True)
class BurgLibrary:
    """An object library of BURG-Toolkit.

    Attributes:
        path: the document.
        name: for people.
        description: for people.
        objects: in the document's order.
        notes: what in the document was not understood and left aside, one sentence each.
    """

    path: Path
    name: str
    description: str
    objects: tuple[BurgObject, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class _Poses:
    """Schema of `stable_poses`."""

    probabilities: tuple[float, ...]
    poses: tuple[Matrix, ...]

    def __post_init__(self) -> None:
        if len(self.probabilities) != len(self.poses):
            raise InvalidInputError(
                f"has {len(self.probabilities)} probabilities, but {len(self.poses)}"
                " poses; give one probability for each pose"
            )
        for i, probability in enumerate(self.probabilities):
            if probability < 0.0:
                raise InvalidInputError(f"probabilities[{i}] is {probability:g}; it must be >= 0")
        for i, X_SO in enumerate(self.poses):
            check_pose(X_SO, f"poses[{i}]")


@dataclass(frozen=True, kw_only=True)
class _Object:
    """Schema of an object; the defaults are those of BURG-Toolkit's `ObjectType`."""

    identifier: str
    name: str | None = None
    mesh_fn: str | None = None
    mass: float | None = None
    friction_coeff: float | None = None
    scale: float | None = None
    thumbnail_fn: str | None = None
    urdf_fn: str | None = None
    vhacd_fn: str | None = None
    stable_poses: _Poses | None = None

    def __post_init__(self) -> None:
        if not self.identifier:
            raise InvalidInputError("identifier is empty; give the object a name")
        if not self.mesh_fn:
            raise InvalidInputError(
                f"{self.identifier!r} has no mesh_fn: BURG-Toolkit had its mesh only in"
                " memory; save the mesh to a file and name it here"
            )
        for label, value in (("mass", self.mass), ("friction_coeff", self.friction_coeff)):
            if value is not None and value < 0.0:
                raise InvalidInputError(
                    f"{label} of {self.identifier!r} is {value:g}; it must be >= 0"
                )
        if self.scale is not None and self.scale <= 0.0:
            raise InvalidInputError(
                f"scale of {self.identifier!r} is {self.scale:g}; it must be above 0"
            )


@dataclass(frozen=True, kw_only=True)
class _BurgLibraryDocument:
    """Schema of the file."""

    yaml_file_type: str
    yaml_file_version: str
    objects: tuple[_Object, ...]
    name: str | None = None
    description: str | None = None


def read_burg_library(path: str | Path) -> BurgLibrary:
    """Reads an object library of BURG-Toolkit.

    Args:
        path: the `object_library.yaml`, or the folder that has it.

    Returns:
        Its contents. Keys that version 1.0 does not have are left aside, with a note.

    Raises:
        DocumentError: it is no such file or of another version, or a value cannot be used; the
            message names file, line and key.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "object_library.yaml"
    node = load_nodes(path)
    reader = BurgReader(str(path))
    reader.check_kind(node, FILE_TYPE, FILE_VERSION, "an object library", OTHER_FILE_HINTS)
    document = cast(_BurgLibraryDocument, reader.read(node, _BurgLibraryDocument, ""))
    lines = reader.item_lines(node, "objects")
    first: dict[str, int] = {}
    for i, (item, line) in enumerate(zip(document.objects, lines, strict=True)):
        if item.identifier in first:
            raise DocumentError(
                f"{path}:{line}: objects[{i}].identifier: {item.identifier!r} is taken by the"
                f" object in line {first[item.identifier]}; identifiers must differ"
            )
        first[item.identifier] = line
    return BurgLibrary(
        path=path,
        name=document.name or "",
        description=document.description or "",
        objects=tuple(
            _burg_object(item, path.parent, line)
            for item, line in zip(document.objects, lines, strict=True)
        ),
        notes=tuple(reader.notes),
    )


def _burg_object(item: _Object, folder: Path, line: int) -> BurgObject:
    poses = item.stable_poses
    recorded = [] if poses is None else zip(poses.probabilities, poses.poses, strict=True)
    return BurgObject(
        identifier=item.identifier,
        name=item.name or item.identifier,
        mesh=cast(Path, relocated(item.mesh_fn, folder)),
        scale=1.0 if item.scale is None else item.scale,
        mass=item.mass or None,
        friction=item.friction_coeff or None,
        stable_poses=tuple(
            BurgStablePose(probability=p, X_SO=Pose.from_matrix(X_SO, quaternion=True))
            for p, X_SO in sorted(recorded, key=lambda pair: -pair[0])
        ),
        thumbnail=relocated(item.thumbnail_fn, folder),
        urdf=relocated(item.urdf_fn, folder),
        vhacd=relocated(item.vhacd_fn, folder),
        line=line,
    )
