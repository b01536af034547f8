"""The scene document: printed board with markers, instances, and how the scene was sampled.

A scene lists objects of a library with their poses on the board. A recipe and
a number determine a sampled scene.
"""

from __future__ import annotations

import glob
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    MAX_DOCUMENT_SEED,
    Array,
    DocumentError,
    FieldError,
    InvalidInputError,
    Pose,
    Ranges,
    UnknownNameError,
    content_hash,
    dump_document,
    load_document,
    plain_data,
    require_finite,
    require_name,
    require_ranges,
    resolve_reference,
    save_document,
    setting,
    suggest_names,
)
from burg_drake.objects import ObjectEntry, ObjectLibrary, load_library

MARKER_EDGE_MARGIN = 0.010
"""Metres from the sheet's edge: unprintable margin and quiet zone."""


@dataclass(frozen=True, kw_only=True)
class Markers:
    """A grid of ArUco markers in the middle of the board, numbered row by row from the upper left.

    Attributes:
        dictionary: name of the dictionary in OpenCV, without `DICT_`.
        side: length of a marker's side, with its black border [m].
        spacing: width of the gap between markers [m].
        count: number of columns and rows; as many as fit if left out.
        first_id: id of the marker in the upper left corner.
    """

    dictionary: str = "ARUCO_MIP_36h12"
    side: float = 0.045
    spacing: float = 0.015
    count: tuple[int, int] | None = None
    first_id: int = 0

    def __post_init__(self) -> None:
        if not (0.0 < self.side < np.inf and 0.0 < self.spacing < np.inf):
            raise InvalidInputError("side and spacing of markers must be above 0 and finite [m]")
        if self.count is not None and min(self.count) < 1:
            raise FieldError(
                f"count {list(self.count)} must have at least one column and one row", "count"
            )
        if self.first_id < 0:
            raise FieldError(f"first_id {self.first_id} must be at least 0", "first_id")


@dataclass(frozen=True, eq=False)
class MarkerLayout:
    """The markers of a board, placed.

    Attributes:
        dictionary: name of the markers' dictionary in OpenCV, without `DICT_`.
        ids: (N,) numbers of the markers in the dictionary, row by row from the upper left.
        p_SQ: (N, 4, 3) corners in the scene frame [m], clockwise from the marker's upper left, the
            order in which ArUco detectors return them.
        black: (N, K, K) cells that are black, border included, rows from the top.
    """

    dictionary: str
    ids: NDArray[np.int32]
    p_SQ: Array
    black: NDArray[np.bool_]

    @property
    def cells(self) -> int:
        """Cells along a marker's side, border included (8 for `ARUCO_MIP_36h12`)."""
        return int(self.black.shape[1])

    @property
    def side(self) -> float:
        """Length of a marker's side [m]."""
        return float(self.p_SQ[0, 1, 0] - self.p_SQ[0, 0, 0])


def marker_dictionary(name: str) -> Any:
    """OpenCV's marker dictionary by name (without `DICT_`, in any case).

    Raises:
        InvalidInputError: OpenCV has no dictionary of this name.
    """
    import cv2

    known = {key[5:].lower(): key for key in dir(cv2.aruco) if key.startswith("DICT_")}
    key = known.get(name.lower().removeprefix("dict_"))
    if key is None:
        raise InvalidInputError(
            f"marker dictionary {name!r} does not exist;"
            f" {suggest_names(name, [k[5:] for k in known.values()])}"
        )
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, key))


def marker_layout(size: tuple[float, float], markers: Markers) -> MarkerLayout:
    """Places a board's markers.

    Args:
        size: extents of the sheet along x and y [m].
        markers: markers of the board.

    Raises:
        InvalidInputError: no marker, or not all of `count`, fit on the sheet; the dictionary does
            not exist or has too few markers.
    """
    import cv2

    pitch = markers.side + markers.spacing
    columns, rows = markers.count or _max_columns_and_rows(size, markers.side, pitch)
    extent = np.array([columns, rows]) * pitch - markers.spacing
    if min(columns, rows) < 1 or (extent > np.array(size) + 1e-9).any():
        raise InvalidInputError(
            f"markers of {1e3 * markers.side:g} mm with {1e3 * markers.spacing:g} mm between them"
            f" do not fit on a board of {1e3 * size[0]:g} x {1e3 * size[1]:g} mm"
            + (f" {columns} x {rows} times" if markers.count else "")
            + "; give smaller markers or a larger board"
        )
    dictionary = marker_dictionary(markers.dictionary)
    total, available = columns * rows, len(dictionary.bytesList)
    if markers.first_id + total > available:
        raise InvalidInputError(
            f"{total} markers with ids from {markers.first_id} on need more than the "
            f"{available} ids of {markers.dictionary}; give larger markers, a smaller"
            " first_id or another dictionary"
        )
    left, bottom = (np.array(size) - extent) / 2
    x = left + pitch * np.arange(columns)
    y = bottom + pitch * np.arange(rows)[::-1] + markers.side  # upper edges, from the top row on
    grid = np.stack([*np.meshgrid(x, y), np.zeros((rows, columns))], axis=-1)
    square = markers.side * np.array([[0, 0, 0], [1, 0, 0], [1, -1, 0], [0, -1, 0]], dtype=float)
    ids = np.arange(markers.first_id, markers.first_id + total, dtype=np.int32)
    cells = dictionary.markerSize + 2
    images = [cv2.aruco.generateImageMarker(dictionary, int(i), cells) for i in ids]
    return MarkerLayout(
        markers.dictionary, ids, grid.reshape(-1, 1, 3) + square, np.array(images) == 0
    )


def _max_columns_and_rows(size: tuple[float, float], side: float, pitch: float) -> tuple[int, int]:
    """Columns and rows that fit between the edges."""
    columns, rows = (int((s - 2 * MARKER_EDGE_MARGIN - side) / pitch + 1e-9 + 1.0) for s in size)
    return max(columns, 0), max(rows, 0)


@dataclass(frozen=True, kw_only=True)
class Board:
    """The printed board. The origin of the scene frame S is its lower left corner.

    Attributes:
        size: lengths along x and y [m]; A2 landscape if left out.
        markers: ArUco markers printed on the board.
    """

    size: tuple[float, float] = (0.594, 0.420)
    markers: Markers = Markers()

    def __post_init__(self) -> None:
        max_side = 100.0  # Metres.
        require_finite(self)
        if not 0.0 < min(self.size) <= max(self.size) <= max_side:
            raise InvalidInputError(
                f"board size {list(self.size)} must be above 0 and at most {max_side:g} m;"
                " A2 is [0.594, 0.42]"
            )

    @cached_property
    def layout(self) -> MarkerLayout:
        """Layout of the board's markers; see `marker_layout`.

        Raises:
            InvalidInputError: the markers do not fit.
        """
        return marker_layout(self.size, self.markers)


LayoutName = Literal["random", "wide", "close", "touching", "packed", "heap"]
"""`random`: anywhere on the board; `wide`: with room for an open hand's fingers in between; `close`
and `touching`: beside one another, a few millimetres apart or in contact; `packed`: as dense as it
gets; `heap`: in any orientation above a spot, to be dropped."""
LAYOUT_NAMES: tuple[LayoutName, ...] = get_args(LayoutName)  # Names of the layouts.

PoseChoice = Literal["probability", "uniform", "as_scanned"]
"""How an object's stable pose is chosen. `probability`: by the probabilities of the poses;
`uniform`: each as often; `as_scanned`: as the mesh stands if that is stable, or else the most
probable one."""

DEFAULT_TRIES = 100
"""Random places that are tried for an object."""


@dataclass(frozen=True, kw_only=True)
class SceneRecipe:
    """How scenes are drawn.

    Example::

        recipe = burg.SceneRecipe(library="household", count=6, layout="close", seed=7)
        burg.save_scene(burg.sample_scene(recipe).scene.document, "lunch.yaml")

    Files have all of its values, because defaults may change between versions.

    Attributes:
        library: object library: its folder, relative to this file, or the name of a built-in one.
        count: number of objects in a scene.
        only: names of the objects to draw from; all that can stand if empty.
        repeat: whether an object may be in a scene several times.
        board: the board on which the objects stand.
        layout: `random`: anywhere. `wide`: with room for fingers in between. `close`, `touching`:
            beside one another, a few millimetres apart or in contact. `packed`: as dense as
            possible. `heap`: dropped on a spot.
        poses: which stable pose an object gets: by probability, each as often (`uniform`), or as
            its mesh stands (`as_scanned`).
        tries: number of random places tried for each object.
        fewer: whether a scene is accepted in which some objects found no place.
        seed: seed of all random choices; another one gives other scenes.
        station: station: its file, relative to this file, or the name of a built-in one. Its boxes
            are obstacles, objects come to rest on its table, and `within_reach` and `visible_from`
            are about its arm and cameras.
        settle: whether objects come to rest in simulation.
        attempts: number of drafts of a scene until the attempt is given up.
        within_reach: whether the arm has to be able to grasp every object.
        clear_grasps: number of grasps that have to be free of collisions for every object.
        visible_from: name of a camera of the station that has to see at least half of every object;
            none if empty.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True

    RANGES: ClassVar[Ranges] = {
        "count": (1, 1000),
        "seed": (0, MAX_DOCUMENT_SEED),
        "tries": (1, 1_000_000),
        "attempts": (1, 100_000),
        "clear_grasps": (0, 1_000_000),
    }

    library: str
    count: int = 6
    only: tuple[str, ...] = ()
    repeat: bool = setting(False, "allow an object several times in a scene")
    board: Board = Board()
    layout: LayoutName = "random"
    poses: PoseChoice = setting(
        "probability", "how to choose an object's stable pose", choices=get_args(PoseChoice)
    )
    tries: int = setting(DEFAULT_TRIES, "random places to try for each object", metavar="K", low=1)
    fewer: bool = setting(False, "accept scenes with fewer objects if some found no place")
    seed: int = setting(0, "random seed", high=MAX_DOCUMENT_SEED)
    station: str = "panda_tabletop"
    settle: bool = setting(True, "do not settle objects in simulation", name="no_settle")
    attempts: int = setting(100, "scenes to sample until one is accepted", low=1)
    within_reach: bool = setting(False, "require that the arm can grasp each object")
    clear_grasps: int = setting(
        0, "require K grasps on each object with a clear hand", metavar="K", low=1
    )
    visible_from: str = setting(
        "", "require that this camera of the station sees half of each object", metavar="CAMERA"
    )

    def __post_init__(self) -> None:
        require_ranges(self)

    @property
    def content(self) -> str:
        """Hash of all fields except the paths of library and station; seeds of scenes derive from
        it."""
        return content_hash(dump_document(replace(self, library="", station="")))


@dataclass(frozen=True, kw_only=True)
class SamplingProvenance:
    """What all scenes of a folder were sampled with (`recipe.yaml`).

    Attributes:
        recipe: how scenes are drawn.
        library_content: hash of the library's objects.
        station_content: hash of the station.
        versions: versions of the software and the machine.
    """

    version: int = 1
    recipe: SceneRecipe
    library_content: str
    station_content: str
    versions: dict[str, str] = field(default_factory=dict)

    def differences(self, other: SamplingProvenance) -> list[str]:
        """Differences in words, in which `self` is "there" and `other` is "here". Libraries and
        stations are compared by content, not by path; versions only of packages that matter."""
        # Packages whose versions change sampled scenes.
        packages = ("burg_drake", "drake", "numpy", "scipy")
        found = []
        for name, there in vars(self.recipe).items():
            here = getattr(other.recipe, name)
            if name not in ("library", "station") and there != here:
                texts = f"{_value_text(there)} there, {_value_text(here)} here"
                found.append(f"{name.replace('_', ' ')} is {texts}")
        for name in ("library", "station"):
            there, here = (getattr(one, f"{name}_content") for one in (self, other))
            if there != here:
                found.append(f"the {name} has content {there} there, {here} here")
        for name in packages:
            there, here = (one.versions.get(name, "unknown") for one in (self, other))
            if there != here:
                found.append(f"{name} is {there} there, {here} here")
        return found


@dataclass(frozen=True, kw_only=True)
class SceneOrigin(SamplingProvenance):
    """How one scene was sampled.

    Attributes:
        number: number of the scene in its folder.
        attempt: number of the accepted draft, from 1.
    """

    number: int
    attempt: int


def _value_text(value: object) -> str:
    if isinstance(value, tuple):
        return ", ".join(map(str, value)) or "none"
    if isinstance(value, bool):
        return "on" if value else "off"
    size = getattr(value, "size", None)
    if isinstance(size, tuple):
        return f"{1e3 * size[0]:g} x {1e3 * size[1]:g} mm with {getattr(value, 'markers', '')}"
    return str(value) or "none"


@dataclass(frozen=True, kw_only=True)
class Instance:
    """An object placed in the scene.

    Attributes:
        name: name of this instance, unique in the scene; the object's name if left out. Letters,
            digits, `_`, `-` and `.`.
        object: name of the object in the library.
        X_SO: pose of the object's frame in the scene frame.
    """

    name: str = ""
    object: str
    X_SO: Pose = Pose()

    def __post_init__(self) -> None:
        require_name(self.name or self.object, "name" if self.name else "object")


@dataclass(frozen=True, kw_only=True)
class SceneDocument:
    """A scene: objects of a library on a printed board.

    Attributes:
        name: name of the scene. Letters, digits, `_`, `-` and `.`.
        description: text for people.
        library: object library: its folder, relative to the scene file, or the name of a built-in
            one such as `household`.
        board: the printed board, whose lower left corner is the origin of the scene.
        instances: objects that are free to move, and to be grasped.
        background: objects that are fixed where they are.
        origin: how the scene was sampled; leave it out in scenes made by hand.
    """

    version: int = 1
    name: str
    description: str = ""
    library: str
    board: Board = Board()
    instances: tuple[Instance, ...] = ()
    background: tuple[Instance, ...] = ()
    origin: SceneOrigin | None = None

    def __post_init__(self) -> None:
        require_name(self.name, "name")


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene with its library at hand.

    Example::

        scene = burg.load_scene("tabletop_six")
        for name in scene.instances:
            print(name, scene.X_SO(name)[:3, 3])

    Attributes:
        document: contents of the scene file.
        library: the library that the instances refer to.
        path: the scene file.
    """

    document: SceneDocument
    library: ObjectLibrary
    path: Path

    def __repr__(self) -> str:
        fixed = f", {len(self.background)} in the background" if self.background else ""
        return f"Scene({self.name!r}, {len(self.instances)} objects{fixed}, {str(self.path)!r})"

    @property
    def name(self) -> str:
        """The scene's name."""
        return self.document.name

    @property
    def board(self) -> Board:
        """The printed board."""
        return self.document.board

    @cached_property
    def instances(self) -> dict[str, Instance]:
        """Free instances by name, in the document's order."""
        return {i.name or i.object: i for i in self.document.instances}

    @cached_property
    def background(self) -> dict[str, Instance]:
        """Fixed instances by name."""
        return {i.name or i.object: i for i in self.document.background}

    def require_markers(self) -> None:
        """Refuses a board with impossible markers.

        Raises:
            InvalidInputError: see `marker_layout`; the message names file and key.
        """
        try:
            _ = self.board.layout
        except InvalidInputError as error:
            raise InvalidInputError(f"{self.path}: board.markers: {error}") from error

    def instance(self, name: str) -> Instance:
        """A free or fixed instance.

        Raises:
            UnknownNameError: no such instance.
        """
        known = {**self.background, **self.instances}
        if name not in known:
            raise UnknownNameError(
                f"scene {self.name!r} has no {name!r}; {suggest_names(name, known)}"
            )
        return known[name]

    def entry(self, name: str) -> ObjectEntry:
        """Library entry of an instance."""
        return self.library.entry(self.instance(name).object)

    def X_SO(self, name: str) -> Array:
        """(4, 4) pose of an instance in the scene frame."""
        return self.instance(name).X_SO.matrix()

    @cached_property
    def content(self) -> str:
        """Hash of the placement and of every object in it, independent of file paths and origin."""
        objects = {i.object for i in (*self.instances.values(), *self.background.values())}
        placed = plain_data(replace(self.document, description="", origin=None)) | {
            "name": "",
            "library": "",
        }
        return content_hash(
            dump_document(placed), {name: self.library.content[name] for name in objects}
        )


def load_scene(
    reference: str | Path, *, library: Callable[[str, Path | None], ObjectLibrary] = load_library
) -> Scene:
    """Loads a scene and its library.

    Example::

        scene = burg.load_scene("tabletop_six")  # built in; or a path
        print(list(scene.instances), scene.X_SO("mug")[:3, 3])

    Args:
        reference: path of a scene file, or the bare name of a built-in scene.
        library: function that loads a library by its reference and the folder that this is relative
            to.

    Raises:
        UnknownNameError: no such file or library, or an instance of an unknown object.
        DocumentError: the file does not fit the schema, two instances share a name, or a free one
            has no mass.
    """
    path = resolve_reference(reference, "scenes")
    document = load_document(path, SceneDocument)
    try:
        objects = library(document.library, path.parent)
    except UnknownNameError as error:
        raise UnknownNameError(f"{path}: library: {error}") from error
    return place_objects(document, objects, path)


def place_objects(
    document: SceneDocument, objects: ObjectLibrary, path: Path, key_prefix: str = ""
) -> Scene:
    """Makes a scene of a document whose library is loaded.

    Args:
        document: the scene.
        objects: its library.
        path: file of the document.
        key_prefix: key of the scene in that file, for messages, such as `scenes[2].`.

    Raises:
        UnknownNameError, DocumentError: as `load_scene`.
    """
    seen: dict[str, str] = {}
    for key, instances in (("instances", document.instances), ("background", document.background)):
        for i, instance in enumerate(instances):
            where = f"{path}: {key_prefix}{key}[{i}]"
            try:
                entry = objects.entry(instance.object)
            except UnknownNameError as error:
                raise UnknownNameError(f"{where}: {error}") from error
            if entry.is_fixed and key == "instances":
                raise DocumentError(
                    f"{where}: {instance.object!r} has no mass, so it cannot be a free"
                    " object; list it under background, or build it with a mass"
                )
            name = instance.name or instance.object
            if name in seen:
                raise DocumentError(
                    f"{where}: the name {name!r} is used already, by {seen[name]}; give"
                    f" this instance another one, such as name: {name}_2"
                )
            seen[name] = f"{key}[{i}]"
    return Scene(document, objects, path)


SceneLike = Scene | str | Path
"""A loaded scene, or an argument of `load_scene`: a path, or the name of a built-in scene."""


def as_scene(scene: SceneLike) -> Scene:
    """Returns a scene, loaded if it is given by name.

    Raises:
        UnknownNameError, DocumentError: see `load_scene`.
    """
    return scene if isinstance(scene, Scene) else load_scene(scene)


def save_scene(document: SceneDocument, path: str | Path) -> None:
    """Writes a scene file.

    Example::

        scene = burg.sample_scene(burg.SceneRecipe(library="household", count=4)).scene
        burg.save_scene(scene.document, "sampled.yaml")
    """
    save_document(document, path)


def scene_references(references: Iterable[str]) -> list[str]:
    """Expands folders and patterns into references of single scenes.

    Args:
        references: scene references as for `load_scene`; folders, for all scenes in them; or
            patterns, which the shell has not expanded, for matching files.

    Returns:
        References in the given order, sorted within a folder or pattern.

    Raises:
        InvalidInputError: a folder has no scenes, or no file matches a pattern.
    """
    found: list[str] = []
    for reference in references:
        path = Path(reference)
        if path.is_dir():
            found += map(str, _scenes_in_folder(path))
        elif any(sign in reference for sign in "*?[") and not path.exists():
            files = sorted(glob.glob(reference))
            if not files:
                raise InvalidInputError(f"no file matches {reference}; give scene files")
            found += files
        else:
            found.append(reference)
    return found


def _scenes_in_folder(folder: Path) -> list[Path]:
    # Documents that may lie beside scenes.
    other_documents = ("recipe.yaml", "library.yaml", "run.yaml", "campaign.yaml", "station.yaml")
    sampled = sorted(folder.glob("scene_*.yaml"), key=lambda path: (len(path.name), path.name))
    others = [path for path in sorted(folder.glob("*.yaml")) if path.name not in other_documents]
    if not (sampled or others):
        raise InvalidInputError(f"folder {folder} has no scenes (*.yaml); give scene files")
    return sampled or others
