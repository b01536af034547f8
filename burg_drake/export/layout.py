"""Objects and station boxes placed in the world, and their names in the target format."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from burg_drake.core import NO_PACKAGES, Array, InvalidInputError, Packages, unused_name
from burg_drake.objects import ObjectEntry, ObjectLibrary
from burg_drake.scene import Scene
from burg_drake.station import FixedBox, Station, obstacle_boxes, table_box


@dataclass(frozen=True, eq=False)
class PlacedObject:
    """A placed instance of a scene.

    Attributes:
        name: name of the instance.
        object: name of the object in the library.
        entry: entry of the object in the library.
        X_WO: (4, 4) pose in the world.
        fixed: whether it is background, which does not move.
    """

    name: str
    object: str
    entry: ObjectEntry
    X_WO: Array
    fixed: bool


@dataclass(frozen=True, eq=False)
class Layout:
    """A scene, and perhaps a station, in the world W.

    Attributes:
        name: name of the scene.
        library: library of the scene's objects.
        objects: placed objects, free ones first, in the document's order.
        boxes: table and obstacles by name; none without a station.
        packages: packages that the objects' models may name.
    """

    name: str
    library: ObjectLibrary
    objects: tuple[PlacedObject, ...]
    boxes: dict[str, FixedBox] = field(default_factory=dict)
    packages: Packages = NO_PACKAGES

    @property
    def entries(self) -> dict[str, ObjectEntry]:
        """Library entries of the placed objects by name, without repetition."""
        return {placed.object: placed.entry for placed in self.objects}


def lay_out(scene: Scene, station: Station | None = None) -> Layout:
    """Places a scene in the world.

    Args:
        scene: the scene.
        station: where it stands; without one the world is the scene frame S, and there is no table.

    Raises:
        InvalidInputError: an instance has the name of the table or of an obstacle of the station.
    """
    if station is None:
        return Layout(scene.name, scene.library, _place_objects(scene, np.eye(4)))
    boxes = {"table": table_box(station), **obstacle_boxes(station)}
    objects = _place_objects(scene, station.document.X_WS.matrix())
    for placed in objects:
        if placed.name in boxes:
            raise InvalidInputError(
                f"{scene.path}: instance name {placed.name!r} is taken by station {station.path};"
                " choose another"
            )
    return Layout(scene.name, scene.library, objects, boxes, station.packages)


def _place_objects(scene: Scene, X_WS: Array) -> tuple[PlacedObject, ...]:
    return tuple(
        PlacedObject(
            name,
            scene.instance(name).object,
            scene.entry(name),
            X_WS @ scene.X_SO(name),
            name in scene.background,
        )
        for name in (*scene.instances, *scene.background)
    )


_RESERVED_NAMES = re.compile(r"world|__.*__|(?:World|Default)ModelInstance")
"""Names reserved by SDFormat and Drake; MuJoCo reserves `world`, too."""


def legal_model_name(name: str) -> str:
    """A name that is not reserved by SDFormat, Drake or MuJoCo."""
    return f"{name}_1" if _RESERVED_NAMES.fullmatch(name) else name


def model_names(layout: Layout) -> dict[str, str]:
    """Names of models in SDFormat, Drake and MJCF, by the names of instances and boxes."""
    return _make_unique(layout, legal_model_name)


def prim_names(layout: Layout) -> dict[str, str]:
    """Names of prims in USD: letters, digits and `_`, no digit in front."""
    return _make_unique(layout, lambda name: re.sub(r"^(?=\d)|[^A-Za-z0-9_]", "_", name))


def renaming_notes(names: Mapping[str, str]) -> tuple[str, ...]:
    """Notes on names that differ in the export, one sentence each."""
    return tuple(
        f"{name!r} is called {legal!r} in the export, as the format does not allow the name"
        for name, legal in names.items()
        if legal != name
    )


def _make_unique(layout: Layout, legal: Callable[[str], str]) -> dict[str, str]:
    """Keeps legal names, and makes unique ones for the others."""
    names = [*(placed.name for placed in layout.objects), *layout.boxes]
    by_name = {name: name for name in names if legal(name) == name}
    for name in names:
        if name not in by_name:
            by_name[name] = unused_name(legal(name), by_name.values())
    return {name: by_name[name] for name in names}
