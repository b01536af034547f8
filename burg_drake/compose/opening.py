"""What a session begins with: a scene from a file, a built-in one, or an empty board."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from burg_drake.compose.board_change import board_size
from burg_drake.compose.scene_file import fingerprint
from burg_drake.compose.state import State
from burg_drake.core.errors import UnknownNameError
from burg_drake.core.resources import builtin_names, data_root, resolve
from burg_drake.objects.library import LIBRARY_FILE, load_library
from burg_drake.scene.scene import Board, SceneDocument, load_scene

NEW_SCENE = "new_scene"
"""What a scene is called before somebody names it."""


@dataclass(frozen=True)
class Opened:
    """What was opened.

    Attributes:
        state: scene and library.
        path: the scene's file; None if it has none yet.
        known: `scene_file.fingerprint` of that file.
    """

    state: State
    path: Path | None = None
    known: str | None = None


def open_reference(reference: str | Path) -> Opened:
    """Opens a scene, or a library; see `ComposeSession.open`."""
    text = str(reference)
    if text in builtin_names("models"):
        return new_scene(text)
    try:
        path = resolve(reference, "scenes")
    except UnknownNameError as error:
        known = f"; libraries: {', '.join(builtin_names('models'))}"
        raise UnknownNameError(f"{error}{known}") from error
    if path.is_dir() or path.name == LIBRARY_FILE:
        return new_scene(text)
    if path.is_relative_to(data_root() / "scenes"):
        return _built_in(path)
    return open_scene_file(path)


def open_scene_file(path: Path) -> Opened:
    """Opens a scene's file.

    Raises:
        UnknownNameError: there is none, or an instance's object is unknown.
        DocumentError: it does not fit the schema.
    """
    known = fingerprint(path)
    scene = load_scene(path)
    return Opened(State(scene.document, scene.library), scene.path, known)


def new_scene(library: str | Path) -> Opened:
    """An empty board, A3 across, with the objects of a library at hand."""
    loaded = load_library(library)
    name = str(library) if str(library) in builtin_names("models") else str(loaded.root)
    document = SceneDocument(name=NEW_SCENE, library=name, board=Board(size=board_size("A3")))
    return Opened(State(document, loaded))


def _built_in(path: Path) -> Opened:
    """A scene that the package installs: the start of a new one, as its file is not the user's."""
    scene = load_scene(path)
    return Opened(State(scene.document, scene.library))
