"""Scenes of other collections as scene documents: those of BURG-Toolkit."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from burg_drake.core import InvalidInputError, UnknownNameError, nearest
from burg_drake.core.paths import name_from
from burg_drake.formats.collections import BurgInstance, BurgScene
from burg_drake.objects.library import ObjectLibrary
from burg_drake.pipeline.source import object_name
from burg_drake.scene.document import Board, Instance, Markers, SceneDocument
from burg_drake.station.document import MODEL_NAMES


@dataclass(frozen=True)
class ImportedScene:
    """A scene of another collection.

    Attributes:
        document: the scene.
        notes: what became other than it was, one sentence each.
    """

    document: SceneDocument
    notes: tuple[str, ...] = ()


def import_burg_scene(
    scene: BurgScene, library: ObjectLibrary, name: str = "", reference: str = ""
) -> ImportedScene:
    """The scene document of a scene of BURG-Toolkit.

    Objects are those that `pipeline.object_imports.burg_sources` makes of the scene's object
    library, by `object_name(identifier)`. What has no mass there is background, whichever list it
    is in. Instances have no names in BURG-Toolkit; they get those of their objects, the second one
    of an object `NAME_2` and so on. One that would be called as something of every station, such as
    `table`, begins with `NAME_1`. The board is the scene's printout with its markers; without one
    it has the size of the ground area and the markers of this project.

    Args:
        scene: from `formats.collections.burg_scene.read_burg_scene`.
        library: has the objects.
        name: of the document; that of the scene's file if empty.
        reference: how the document refers to the library; its folder if empty.

    Raises:
        UnknownNameError: the library lacks objects; the message names file and line of each.
        InvalidInputError: an identifier makes no object name; the printout's markers do not exist
            or do not fit.
    """
    names = _Names(scene, library)
    free, fixed, notes = [], [], []
    for item in scene.objects:
        instance = names.instance(item)
        if library.entry(instance.object).is_fixed:
            fixed.append(instance)
            notes.append(
                f"{scene.path}:{item.line}: {instance.object!r} has no mass, so it"
                " becomes background, which does not move"
            )
        else:
            free.append(instance)
    fixed += [names.instance(item) for item in scene.bg_objects]
    notes += [
        f"an instance of object {i.object!r} is called {i.name!r}, as every station has"
        f" something called {i.object!r} already"
        for i in (*free, *fixed)
        if i.object in MODEL_NAMES
    ]
    document = SceneDocument(
        name=name or name_from(scene.path.stem),
        description=f"Imported from BURG-Toolkit's {scene.path.name}",
        library=reference or str(library.root),
        board=_board(scene),
        instances=tuple(free),
        background=tuple(fixed),
    )
    return ImportedScene(document, tuple(notes))


def _board(scene: BurgScene) -> Board:
    printout = scene.printout
    if printout is None:
        return Board(size=scene.ground_area)
    markers = Markers(
        dictionary=printout.dictionary,
        side=printout.side,
        spacing=printout.spacing,
        count=printout.count,
    )
    board = Board(size=printout.size, markers=markers)
    try:
        _ = board.layout
    except InvalidInputError as error:
        raise InvalidInputError(f"{scene.path}: printout: {error}") from error
    return board


class _Names:
    """Finds objects, and gives names to their instances."""

    def __init__(self, scene: BurgScene, library: ObjectLibrary) -> None:
        self.scene = scene
        self.library = library
        self.count: Counter[str] = Counter()
        items = sorted((*scene.objects, *scene.bg_objects), key=lambda item: item.line)
        self.taken = {object_name(item.object_type) for item in items}
        lacking = [i for i in items if object_name(i.object_type) not in library.objects]
        if lacking:
            lines = [f"{scene.path}:{i.line}: {self._require_object(i)}" for i in lacking]
            raise UnknownNameError("; ".join(lines))

    def _require_object(self, item: BurgInstance) -> str:
        name = object_name(item.object_type)
        return (
            f"object {name!r} ({item.object_type!r}) is not in library {self.library.root};"
            f" {nearest(name, self.library.objects)}"
        )

    def instance(self, item: BurgInstance) -> Instance:
        object = object_name(item.object_type)
        self.count[object] += 1
        if self.count[object] == 1 and object not in MODEL_NAMES:
            return Instance(object=object, X_SO=item.X_SO)
        while f"{object}_{self.count[object]}" in self.taken:  # an object may be called mug_2
            self.count[object] += 1
        return Instance(name=f"{object}_{self.count[object]}", object=object, X_SO=item.X_SO)
