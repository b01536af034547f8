"""Reads object libraries and scenes of BURG-Toolkit (version 1.0).

`YAMLObject.dump_yaml_data` in burg_toolkit/io.py (github.com/mrudorfer/burg-toolkit) writes them:
`yaml_file_type` and `yaml_file_version` say what a file is, keys are sorted, what is not known is
null, and paths are relative to the file, in the writer's spelling: with backslashes from Windows.

Libraries, `object_library.yaml`: the layout is that of `ObjectLibrary.to_yaml` in
burg_toolkit/core.py, and of a file that it wrote, object_library/object_library.yaml of
github.com/mrudorfer/jogramop-framework:

- `yaml_file_type` is ObjectLibrary. `objects` is a list. `scale` came later without a new version
  number: some files do not have it.
- A mass of 0, which is also what becomes of a missing one, fixes an object in space
  (`ObjectType.__init__`); here it has no mass. A friction coefficient of 0 or none becomes 0.24.
- `scale` belongs to the object, not to its mesh file: objects that share a mesh file differ in it,
  and mesh and convex pieces are scaled on loading (scripts/acronym/create_object_library.py;
  `save_urdf` in io.py writes it into `<mesh scale=...>`). Lengths of stable poses are therefore
  taken to be metres of the scaled object; all files seen with poses have scale 1.
- Stable poses come from the simulated fall of each pose that trimesh finds, at most ten of them,
  with the support at z = 0; near-duplicates are kept (`compute_stable_poses` in
  mesh_processing.py). Their probabilities need not add up to 1.

Scenes: the layout is that of `Scene.to_yaml` in burg_toolkit/core.py, and of files that it wrote,
scenarios/*/scene.yaml of github.com/mrudorfer/jogramop-framework:

- The ground area extends from the origin to (ground_area_x, ground_area_y) in the plane z = 0, z
  up. That is our scene frame S on a board of that size.
- `objects` are free, `bg_objects` are fixed. Each has the identifier of its type in the object
  library, and the pose (4, 4) of the type's mesh after scaling. There are no names of instances.
- `object_library_fn` leads to the library, relative to the scene; null if it was not told.
- `printout` is null, or has the printed board, with the same lower left corner as the ground area
  and at least as large: `size` [m], and the grid of markers in the middle of it, `marker_info`:
  `aruco_dict` ("DICT_4X4_250"), `marker_count_x`, `marker_count_y`, `marker_size_mm`,
  `marker_spacing_mm` (burg_toolkit/printout.py). Ids count from 0 row by row from the upper left.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import yaml

from burg_drake.core import (
    DocumentError,
    FieldError,
    InvalidInputError,
    Pose,
    Reader,
    check_pose,
    load_yaml_node,
    quote_value,
    suggest_names,
)
from burg_drake.formats.pose_files import nearest_rigid

MatrixRow = tuple[float, float, float, float]
Matrix = tuple[MatrixRow, MatrixRow, MatrixRow, MatrixRow]
"""A pose as lists of numbers."""


class BurgReader(Reader):
    """Document reader that ignores keys that the schema lacks.

    Attributes:
        notes: ignored keys, one sentence each.
    """

    def __init__(self, name: str) -> None:
        """Begins to read the document in the file `name`."""
        super().__init__(name)
        self.notes: list[str] = []

    def read_dataclass(self, node: yaml.Node, kind: type, where: str) -> Any:
        known = kind.__dataclass_fields__  # type: ignore[attr-defined]
        if isinstance(node, yaml.MappingNode):
            pairs = []
            for key, (key_node, value) in self.read_entries(node, where).items():
                if key in known:
                    pairs.append((key_node, value))
                    continue
                place = (
                    f"{self.name}:{key_node.start_mark.line + 1}:{f' {where}:' if where else ''}"
                )
                self.notes.append(
                    f"{place} unknown key {key!r} was ignored; {suggest_names(key, known)}"
                )
            node = yaml.MappingNode(node.tag, pairs, node.start_mark, node.end_mark)
        return super().read_dataclass(node, kind, where)

    def item_lines(self, node: yaml.Node, key: str) -> list[int]:
        """Lines on which the items of a list of the document begin."""
        entries = self.read_entries(node, "")
        items = entries[key][1].value if key in entries else []
        return [item.start_mark.line + 1 for item in items]

    def check_kind(self, node: yaml.Node, type: str, title: str, other: str, hint: str) -> None:
        """Refuses other files, and other versions than 1.0.

        Args:
            node: the document.
            type: expected `yaml_file_type`.
            title: kind of file in words.
            other: the other `yaml_file_type` of BURG-Toolkit.
            hint: advice on files of that type.

        Raises:
            DocumentError: the file has another type or version.
        """
        entries = self.read_entries(node, "")
        for key, expected in (("yaml_file_type", type), ("yaml_file_version", "1.0")):
            if key not in entries:
                raise self.error_at(
                    node,
                    key,
                    f"missing; if this is {title} of an early BURG-Toolkit, which did not write"
                    f" it, add the lines 'yaml_file_type: {type}' and 'yaml_file_version: \"1.0\"'",
                )
            value = entries[key][1]
            given = value.value if isinstance(value, yaml.ScalarNode) else "a structure"
            if given != expected:
                what = f"{quote_value(given)} cannot be read; expected {expected!r}"
                raise self.error_at(value, key, f"{what}; {hint}" if given == other else what)


def locate_file(given: str | None, folder: Path) -> Path | None:
    """Finds a file that a document in `folder` names; if it is missing, the longest tail of its
    path that exists.

    So a library that was moved, or that names files of another machine, still finds
    `/home/someone/library/meshes/mug.obj` as `meshes/mug.obj`.
    """
    if not given:
        return None
    parts = given.replace("\\", "/")
    named = folder / parts
    if os.path.exists(named):  # in contrast to Path.exists, no error for names that are too long
        return named
    names = [name for name in parts.split("/") if name not in ("", ".", "..")]
    ends = (folder.joinpath(*names[i:]) for i in range(len(names)))
    return next((end for end in ends if os.path.isfile(end)), named)


@dataclass(frozen=True, kw_only=True)
class BurgStablePose:
    """A stable pose as BURG-Toolkit recorded it.

    Attributes:
        probability: estimate of trimesh.
        X_SO: pose of the object in a frame whose xy plane is the support.
    """

    probability: float
    X_SO: Pose


@dataclass(frozen=True, kw_only=True)
class BurgObject:
    """An object type of BURG-Toolkit.

    Attributes:
        identifier: identifier, unique in the library.
        name: display name.
        mesh: the mesh file; it need not exist.
        scale: factor from the mesh file's unit to metres.
        mass: mass [kg]; None for an object that BURG-Toolkit fixes in space (mass 0 or absent).
        friction: friction coefficient; None where BURG-Toolkit uses its default of 0.24.
        stable_poses: stable poses, most probable first.
        line: line on which the object begins in the document.
    """

    identifier: str
    name: str
    mesh: Path
    scale: float = 1.0
    mass: float | None = None
    friction: float | None = None
    stable_poses: tuple[BurgStablePose, ...] = ()
    line: int = 0


@dataclass(frozen=True, kw_only=True)
class BurgLibrary:
    """An object library of BURG-Toolkit.

    Attributes:
        path: the document.
        name: display name.
        description: text for people.
        objects: objects in the document's order.
        notes: parts of the document that were not understood and ignored, one sentence each.
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
    """Schema of an object; the defaults are those of BURG-Toolkit's `ObjectType`.

    Its picture, its model for PyBullet and its convex pieces are not used.
    """

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
        Its contents. Keys that version 1.0 does not have are ignored, with a note.

    Raises:
        DocumentError: it is no such file or of another version, or a value cannot be used; the
            message names file, line and key.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "object_library.yaml"
    node = load_yaml_node(path)
    reader = BurgReader(str(path))
    hint = "give the object library that the scene names under object_library_fn"
    reader.check_kind(node, "ObjectLibrary", "an object library", "Scene", hint)
    document = cast(_BurgLibraryDocument, reader.read(node, _BurgLibraryDocument, ""))
    items = list(zip(document.objects, reader.item_lines(node, "objects"), strict=True))
    first: dict[str, int] = {}
    for i, (item, line) in enumerate(items):
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
        objects=tuple(_burg_object(item, path.parent, line) for item, line in items),
        notes=tuple(reader.notes),
    )


def _burg_object(item: _Object, folder: Path, line: int) -> BurgObject:
    poses = item.stable_poses
    recorded = [] if poses is None else zip(poses.probabilities, poses.poses, strict=True)
    return BurgObject(
        identifier=item.identifier,
        name=item.name or item.identifier,
        mesh=cast(Path, locate_file(item.mesh_fn, folder)),
        scale=1.0 if item.scale is None else item.scale,
        mass=item.mass or None,
        friction=item.friction_coeff or None,
        stable_poses=tuple(
            BurgStablePose(probability=p, X_SO=Pose.from_matrix(X_SO, quaternion=True))
            for p, X_SO in sorted(recorded, key=lambda pair: -pair[0])
        ),
        line=line,
    )


@dataclass(frozen=True, kw_only=True)
class BurgInstance:
    """An object in a scene of BURG-Toolkit.

    Attributes:
        object_type: identifier in the object library.
        X_SO: pose of the object's scaled mesh in the scene.
        line: line on which the instance begins in the document.
    """

    object_type: str
    X_SO: Pose
    line: int = 0


@dataclass(frozen=True, kw_only=True)
class BurgMarkers:
    """The markers on a printed board of BURG-Toolkit; keys are those of its files.

    Attributes:
        aruco_dict: dictionary as OpenCV names it.
        marker_count_x, marker_count_y: columns and rows.
        marker_size_mm: length of a marker's side [mm].
        marker_spacing_mm: width of the gap between markers [mm].
    """

    aruco_dict: str
    marker_count_x: int
    marker_count_y: int
    marker_size_mm: float
    marker_spacing_mm: float

    def __post_init__(self) -> None:
        for name in ("marker_count_x", "marker_count_y", "marker_size_mm", "marker_spacing_mm"):
            if getattr(self, name) <= 0:
                raise FieldError(f"{name} is {getattr(self, name):g}; it must be above 0", name)


@dataclass(frozen=True, kw_only=True)
class BurgPrintout:
    """The printed board of a scene of BURG-Toolkit.

    Attributes:
        size: extents along x and y [m], from the ground area's origin.
        marker_info: markers of the printout.
    """

    size: tuple[float, float]
    marker_info: BurgMarkers

    def __post_init__(self) -> None:
        if min(self.size) <= 0.0:
            raise FieldError(f"size {list(self.size)} must be above 0 [m]", "size")


@dataclass(frozen=True, kw_only=True)
class BurgScene:
    """A scene of BURG-Toolkit.

    Attributes:
        path: the document.
        ground_area: extents along x and y [m].
        objects: free objects, in the document's order.
        bg_objects: fixed objects.
        library: document of the object library, which need not exist; None if the scene names none.
        printout: the printed board; None if the scene has none.
        notes: parts of the document that were ignored or changed, one sentence each.
    """

    path: Path
    ground_area: tuple[float, float]
    objects: tuple[BurgInstance, ...]
    bg_objects: tuple[BurgInstance, ...]
    library: Path | None = None
    printout: BurgPrintout | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class _Instance:
    """Schema of an instance."""

    object_type: str
    pose: Matrix


@dataclass(frozen=True, kw_only=True)
class _BurgSceneDocument:
    """Schema of the file."""

    yaml_file_type: str
    yaml_file_version: str
    ground_area_x: float
    ground_area_y: float
    objects: tuple[_Instance, ...]
    bg_objects: tuple[_Instance, ...] = ()
    object_library_fn: str | None = None
    printout: BurgPrintout | None = None

    def __post_init__(self) -> None:
        if min(self.ground_area_x, self.ground_area_y) <= 0.0:
            raise InvalidInputError(
                f"the ground area is {self.ground_area_x:g} x {self.ground_area_y:g} m;"
                " both sides must be above 0"
            )


def read_burg_scene(path: str | Path) -> BurgScene:
    """Reads a scene of BURG-Toolkit.

    Returns:
        Its contents. Keys that version 1.0 does not have are ignored, with a note.

    Raises:
        DocumentError: it is no such file or of another version, or a value cannot be used; the
            message names file, line and key.
        InvalidInputError: a pose is not a rigid transform; the message names file and line.
    """
    path = Path(path)
    node = load_yaml_node(path)
    reader = BurgReader(str(path))
    hint = "give the scene here; libraries are imported by `burg-drake library import-burg`"
    reader.check_kind(node, "Scene", "a scene", "ObjectLibrary", hint)
    document = cast(_BurgSceneDocument, reader.read(node, _BurgSceneDocument, ""))
    notes = reader.notes
    ground_area = (document.ground_area_x, document.ground_area_y)
    if document.printout is not None and document.printout.size != ground_area:
        line = reader.read_entries(node, "")["printout"][0].start_mark.line + 1
        notes.append(
            f"{path}:{line}: the board gets the size of the printout, "
            f"{_size_in_millimetres(document.printout.size)}; the ground area of "
            f"{_size_in_millimetres(ground_area)} was ignored"
        )
    placed: dict[str, list[BurgInstance]] = {"objects": [], "bg_objects": []}
    for key, instances in placed.items():
        for item, line in zip(getattr(document, key), reader.item_lines(node, key), strict=True):
            where = f"{path}:{line}: pose of {item.object_type!r}"
            (X_SO,), rounded = nearest_rigid([item.pose], where)
            notes += rounded
            pose = Pose.from_matrix(X_SO, quaternion=True)
            instances.append(BurgInstance(object_type=item.object_type, X_SO=pose, line=line))
    return BurgScene(
        path=path,
        ground_area=ground_area,
        objects=tuple(placed["objects"]),
        bg_objects=tuple(placed["bg_objects"]),
        library=locate_file(document.object_library_fn, path.parent),
        printout=document.printout,
        notes=tuple(notes),
    )


def _size_in_millimetres(size: tuple[float, float]) -> str:
    return f"{1e3 * size[0]:g} x {1e3 * size[1]:g} mm"
