"""What an export writes: the objects of a scene and the boxes of a station, placed in the world."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from burg_drake.core import Array, InvalidInputError
from burg_drake.core.paths import NO_PACKAGES, Packages
from burg_drake.objects.library import ObjectEntry, ObjectLibrary
from burg_drake.scene.document import Scene
from burg_drake.station.document import Station
from burg_drake.station.world import FixedBox, obstacle_boxes, table_box


@dataclass(frozen=True, eq=False)
class PlacedObject:
    """An instance of a scene.

    Attributes:
        name: of the instance.
        object: its name in the library.
        entry: of the library.
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
        name: of the scene.
        library: of its objects.
        objects: free ones first, in the document's order.
        boxes: table and obstacles by name; none without a station.
        packages: where packages that the objects' models name are looked for.
    """

    name: str
    library: ObjectLibrary
    objects: tuple[PlacedObject, ...]
    boxes: dict[str, FixedBox] = field(default_factory=dict)
    packages: Packages = NO_PACKAGES

    @property
    def entries(self) -> dict[str, ObjectEntry]:
        """Entries of the objects that are placed, each once, by their names in the library."""
        return {placed.object: placed.entry for placed in self.objects}


def lay_out(scene: Scene, station: Station | None = None) -> Layout:
    """Places a scene in the world.

    Args:
        scene: the scene.
        station: where it stands; without one the world is the scene frame S, and there is no table.

    Raises:
        InvalidInputError: an instance is called as the table or an obstacle of the station.
    """
    if station is None:
        return Layout(scene.name, scene.library, _placed(scene, np.eye(4)))
    boxes = {"table": table_box(station), **obstacle_boxes(station)}
    objects = _placed(scene, station.document.X_WS.matrix())
    for placed in objects:
        if placed.name in boxes:
            raise InvalidInputError(
                f"{scene.path}: instance name {placed.name!r} is taken by station {station.path};"
                " choose another"
            )
    return Layout(scene.name, scene.library, objects, boxes, station.packages)


def _placed(scene: Scene, X_WS: Array) -> tuple[PlacedObject, ...]:
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
