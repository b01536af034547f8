"""The scene document: instances of library objects on the board, as readable YAML."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from burg_drake.core import (
    Array,
    DocumentError,
    InvalidInputError,
    UnknownNameError,
    content_hash,
    nearest,
)
from burg_drake.core.documents import (
    Pose,
    dump_document,
    load_document,
    plain_data,
    save_document,
)
from burg_drake.core.paths import require_name, resolve
from burg_drake.objects.library import ObjectEntry, ObjectLibrary, load_library
from burg_drake.scene.document.board import Board as Board
from burg_drake.scene.document.origin import SceneOrigin


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
        """Refuses a board whose markers cannot be, before anything is done with them.

        Raises:
            InvalidInputError: see `scene.document.markers.marker_layout`; it names the file and the
            key.
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
            raise UnknownNameError(f"scene {self.name!r} has no {name!r}; {nearest(name, known)}")
        return known[name]

    def entry(self, name: str) -> ObjectEntry:
        """Library entry of an instance."""
        return self.library.entry(self.instance(name).object)

    def X_SO(self, name: str) -> Array:
        """(4, 4) pose of an instance in the scene frame."""
        return self.instance(name).X_SO.matrix()

    @cached_property
    def content(self) -> str:
        """Hash of the placement and of every object in it; neither where files are nor the origin
        counts."""
        objects = {i.object for i in (*self.instances.values(), *self.background.values())}
        placed = plain_data(replace(self.document, description="", origin=None)) | {
            "name": "",
            "library": "",
        }
        return content_hash(
            dump_document(placed), {name: self.library.content[name] for name in objects}
        )


def load_scene(
    reference: str | Path,
    *,
    library: Callable[[str, Path | None], ObjectLibrary] = load_library,
) -> Scene:
    """Loads a scene and its library.

    Example::

        scene = burg.load_scene("tabletop_six")  # built in; or a path
        print(list(scene.instances), scene.X_SO("mug")[:3, 3])

    Args:
        reference: path of a scene file, or the bare name of a built-in scene.
        library: loads a library, by its reference and the folder that this is relative to.

    Raises:
        UnknownNameError: no such file or library, or an instance of an unknown object.
        DocumentError: the file does not fit the schema, two instances share a name, or a free one
            has no mass.
    """
    path = resolve(reference, "scenes")
    document = load_document(path, SceneDocument)
    try:
        objects = library(document.library, path.parent)
    except UnknownNameError as error:
        raise UnknownNameError(f"{path}: library: {error}") from error
    seen: dict[str, str] = {}
    for key, instances in (("instances", document.instances), ("background", document.background)):
        for i, instance in enumerate(instances):
            where = f"{path}: {key}[{i}]"
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
"""A scene, loaded or by what `load_scene` takes: a path, or the name of a built-in one."""


def as_scene(scene: SceneLike) -> Scene:
    """A scene, loaded if it is given by name.

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
