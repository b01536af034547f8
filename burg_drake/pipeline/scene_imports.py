"""Scenes of other collections as scene documents: those of BURG-Toolkit."""

from __future__ import annotations

from collections import Counter

from burg_drake.core.errors import InvalidInputError, UnknownNameError, nearest
from burg_drake.core.names import name_from
from burg_drake.formats.burg_scene import BurgInstance, BurgScene
from burg_drake.objects.library import ObjectLibrary
from burg_drake.pipeline.source import object_name
from burg_drake.scene.markers import Markers
from burg_drake.scene.scene import Board, Instance, SceneDocument


def burg_scene_document(
    scene: BurgScene, library: ObjectLibrary, name: str = "", reference: str = ""
) -> SceneDocument:
    """The scene document of a scene of BURG-Toolkit.

    Objects are those that `pipeline.imports.burg_sources` makes of the scene's object library, by
    `object_name(identifier)`. Instances have no names in BURG-Toolkit; they get those of their
    objects, the second one of an object `NAME_2` and so on. The board is the scene's printout with
    its markers; without one it has the size of the ground area and the markers of this project.

    Args:
        scene: from `formats.burg_scene.read_burg_scene`.
        library: has the objects.
        name: of the document; that of the scene's file if empty.
        reference: how the document refers to the library; its folder if empty.

    Raises:
        UnknownNameError: the library lacks an object; the message names file and line.
        InvalidInputError: an identifier makes no object name; the printout's markers do not exist
            or do not fit.
    """
    names = _Names(scene, library)
    return SceneDocument(
        name=name or name_from(scene.path.stem),
        description=f"Imported from BURG-Toolkit's {scene.path.name}",
        library=reference or str(library.root),
        board=_board(scene),
        instances=tuple(names.instance(item) for item in scene.objects),
        background=tuple(names.instance(item) for item in scene.bg_objects),
    )


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
        self.taken = {self.object(item) for item in (*scene.objects, *scene.bg_objects)}

    def object(self, item: BurgInstance) -> str:
        name = object_name(item.object_type)
        if name not in self.library.objects:
            raise UnknownNameError(
                f"{self.scene.path}:{item.line}: object {name!r} ({item.object_type!r}) is not in"
                f" library {self.library.root}; {nearest(name, self.library.objects)}"
            )
        return name

    def instance(self, item: BurgInstance) -> Instance:
        object = self.object(item)
        self.count[object] += 1
        if self.count[object] == 1:
            return Instance(object=object, X_SO=item.X_SO)
        while f"{object}_{self.count[object]}" in self.taken:  # an object may be called mug_2
            self.count[object] += 1
        return Instance(name=f"{object}_{self.count[object]}", object=object, X_SO=item.X_SO)
