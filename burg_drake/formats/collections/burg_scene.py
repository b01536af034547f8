"""Reads the scenes of BURG-Toolkit: `yaml_file_type: Scene`, version 1.0.

What such a file looks like was taken from what writes it, `Scene.to_yaml` in burg_toolkit/core.py
(github.com/mrudorfer/burg-toolkit), and from those that it wrote, scenarios/*/scene.yaml of
github.com/mrudorfer/jogramop-framework:

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

from dataclasses import dataclass
from pathlib import Path
from typing import cast

from burg_drake.core import FieldError, InvalidInputError
from burg_drake.core.documents import Pose, load_nodes
from burg_drake.formats.collections.burg_document import BurgReader, Matrix, relocated
from burg_drake.formats.common import nearest_rigid

FILE_TYPE = "Scene"
FILE_VERSION = "1.0"
OTHER_FILE_HINTS = {
    "ObjectLibrary": (
        "give the scene here; libraries are imported by `burg-drake library import-burg`"
    )
}
"""What to do about other files of BURG-Toolkit."""


@dataclass(frozen=True, kw_only=True)
class BurgInstance:
    """An object in a scene of BURG-Toolkit.

    Attributes:
        object_type: identifier in the object library.
        X_SO: pose of its scaled mesh in the scene.
        line: where it begins in the document.
    """

    object_type: str
    X_SO: Pose
    line: int = 0


@dataclass(frozen=True, kw_only=True)
class BurgPrintout:
    """The printed board of a scene of BURG-Toolkit.

    Attributes:
        size: extents along x and y [m], from the ground area's origin.
        dictionary: of its ArUco markers, as OpenCV names it, without `DICT_`.
        count: columns and rows of markers.
        side: length of a marker's side [m].
        spacing: width of the gap between markers [m].
    """

    size: tuple[float, float]
    dictionary: str
    count: tuple[int, int]
    side: float
    spacing: float


@dataclass(frozen=True, kw_only=True)
class BurgScene:
    """A scene of BURG-Toolkit.

    Attributes:
        path: the document.
        ground_area: extents along x and y [m].
        objects: free objects, in the document's order.
        bg_objects: fixed objects.
        library: the object library's document; it need not exist. None if the scene names none.
        printout: the printed board; None if the scene has none.
        notes: what in the document was left aside or changed, one sentence each.
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
class _MarkerInfo:
    """Schema of the markers of a printout."""

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
class _Printout:
    """Schema of a printout."""

    size: tuple[float, float]
    marker_info: _MarkerInfo

    def __post_init__(self) -> None:
        if min(self.size) <= 0.0:
            raise FieldError(f"size {list(self.size)} must be above 0 [m]", "size")


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
    printout: _Printout | None = None

    def __post_init__(self) -> None:
        if min(self.ground_area_x, self.ground_area_y) <= 0.0:
            raise InvalidInputError(
                f"the ground area is {self.ground_area_x:g} x {self.ground_area_y:g} m;"
                " both sides must be above 0"
            )


def read_burg_scene(path: str | Path) -> BurgScene:
    """Reads a scene of BURG-Toolkit.

    Returns:
        Its contents. Keys that version 1.0 does not have are left aside, with a note.

    Raises:
        DocumentError: it is no such file or of another version, or a value cannot be used; the
            message names file, line and key.
        InvalidInputError: a pose is not a rigid transform; the message names file and line.
    """
    path = Path(path)
    node = load_nodes(path)
    reader = BurgReader(str(path))
    reader.check_kind(node, FILE_TYPE, FILE_VERSION, "a scene", OTHER_FILE_HINTS)
    document = cast(_BurgSceneDocument, reader.read(node, _BurgSceneDocument, ""))
    notes = reader.notes
    ground_area = (document.ground_area_x, document.ground_area_y)
    if document.printout is not None and document.printout.size != ground_area:
        line = reader.entries(node, "")["printout"][0].start_mark.line + 1
        notes.append(
            f"{path}:{line}: the board gets the size of the printout, "
            f"{_millimetres(document.printout.size)}; the ground area of "
            f"{_millimetres(ground_area)} was ignored"
        )
    placed = {}
    for key in ("objects", "bg_objects"):
        items = zip(getattr(document, key), reader.item_lines(node, key), strict=True)
        placed[key] = tuple(_instance(item, str(path), line, notes) for item, line in items)
    return BurgScene(
        path=path,
        ground_area=ground_area,
        objects=placed["objects"],
        bg_objects=placed["bg_objects"],
        library=relocated(document.object_library_fn, path.parent),
        printout=_printout(document.printout),
        notes=tuple(notes),
    )


def _printout(given: _Printout | None) -> BurgPrintout | None:
    if given is None:
        return None
    info = given.marker_info
    return BurgPrintout(
        size=given.size,
        dictionary=info.aruco_dict.removeprefix("DICT_"),
        count=(info.marker_count_x, info.marker_count_y),
        side=round(info.marker_size_mm * 1e-3, 9),
        spacing=round(info.marker_spacing_mm * 1e-3, 9),
    )


def _millimetres(size: tuple[float, float]) -> str:
    return f"{1e3 * size[0]:g} x {1e3 * size[1]:g} mm"


def _instance(item: _Instance, path: str, line: int, notes: list[str]) -> BurgInstance:
    (X_SO,), rounded = nearest_rigid([item.pose], f"{path}:{line}: pose of {item.object_type!r}")
    notes += rounded
    pose = Pose.from_matrix(X_SO, quaternion=True)
    return BurgInstance(object_type=item.object_type, X_SO=pose, line=line)
