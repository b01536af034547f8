"""Opens a scene file, a built-in scene, an empty board, or a session that was killed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

from burg_drake.compose.commands import board_size
from burg_drake.compose.journal import (
    LibraryMissing,
    RecoveredSession,
    journal_path,
    recover_journal,
    set_journal_aside,
)
from burg_drake.compose.scene_storage import SceneInUse, SceneLock, SceneStorage, file_fingerprint
from burg_drake.compose.state import History, State
from burg_drake.core import (
    InvalidInputError,
    UnknownNameError,
    builtin_names,
    data_root,
    portable_reference,
    resolve_reference,
)
from burg_drake.objects import LIBRARY_FILE, load_library
from burg_drake.scene import Board, SceneDocument, load_scene


@dataclass(frozen=True)
class OpenedScene:
    """What was opened.

    Attributes:
        history: with the scene's state, and what came before it if it was recovered.
        storage: its files.
        notices: what the user should know, one line each.
    """

    history: History
    storage: SceneStorage
    notices: tuple[str, ...] = ()


def open_reference(reference: str | Path, folder: str | Path | None, address: str) -> OpenedScene:
    """Opens a scene, or begins a new one; see `ComposeSession.open`."""
    text = str(reference)
    if text in builtin_names("models"):
        return new_scene(text, _scene_folder(folder), address)
    try:
        path = resolve_reference(reference, "scenes")
    except UnknownNameError as error:
        known = f"; libraries: {', '.join(builtin_names('models'))}"
        raise UnknownNameError(f"{error}{known}") from error
    if path.is_dir() or path.name == LIBRARY_FILE:
        return new_scene(text, _scene_folder(folder), address)
    if path.is_relative_to(data_root() / "scenes"):
        return _open_built_in_scene(path, _scene_folder(folder), address)
    return open_scene_file(path, address)


def open_scene_file(path: Path, address: str = "") -> OpenedScene:
    """Opens a scene's file, or what a session that was killed has left of it.

    Raises:
        SceneInUse: another session has it.
        UnknownNameError: there is none, or an instance's object is unknown.
        DocumentError: it does not fit the schema.
    """
    lock = SceneLock(path, address)
    try:
        found = recover_journal(journal_path(path))
        notices = _keep_damaged(found, path)
        known = file_fingerprint(path)
        if found and found.history and found.history.state.document != found.saved:
            if found.known != known:
                notices += (
                    f"{path} was changed by another program; the unsaved changes of the last"
                    " session are shown",
                )
            return _open_recovered(path, path, found, lock, notices)
        if found and found.history and found.known == known:
            return _open_recovered(path, path, found, lock, notices, quiet=True)
        scene = load_scene(path)
        state = State(scene.document, scene.library)
        storage = SceneStorage(path, lock, path=path, known=known, saved=scene.document)
        return OpenedScene(History(state), storage, notices)
    except BaseException:
        lock.release()
        raise


def new_scene(library: str | Path, folder: Path, address: str = "") -> OpenedScene:
    """An empty board, A3 across, with the objects of a library at hand."""
    loaded = load_library(library)
    built_in = str(library) in builtin_names("models")
    reference = str(library) if built_in else portable_reference(loaded.root, folder)

    def make(name: str) -> State:
        board = Board(size=board_size("A3"))
        return State(SceneDocument(name=name, library=reference, board=board), loaded)

    return _open_unsaved_scene("new_scene", make, folder, reference, address)


def _open_built_in_scene(path: Path, folder: Path, address: str) -> OpenedScene:
    """A scene that the package installs: the start of a new one, as its file is not the user's."""
    scene = load_scene(path)

    def make(name: str) -> State:
        return State(replace(scene.document, name=name), scene.library)

    return _open_unsaved_scene(scene.name, make, folder, f"scene {path.stem}", address)


def _open_unsaved_scene(
    name: str, make: Callable[[str], State], folder: Path, origin: str, address: str
) -> OpenedScene:
    """A scene without a file, by the first name that is nobody else's: numbers are put behind it.

    What a session of the same origin has left is recovered.
    """
    notices: tuple[str, ...] = ()
    for number in count(1):
        place = folder / (f"{name}.yaml" if number == 1 else f"{name}_{number}.yaml")
        if place.exists():
            continue
        try:
            lock = SceneLock(place, address)
        except SceneInUse:
            continue
        try:
            found = recover_journal(journal_path(place))
            first = make(place.stem)
            if found is None or found.history is None:
                notices += _keep_damaged(found, place)
                return OpenedScene(
                    History(first), SceneStorage(place, lock, origin=origin), notices
                )
            same_library = found.history.state.library.root == first.library.root
            lost_origin = not found.origin and bool(found.damage) and same_library
            if (found.origin == origin or lost_origin) and found.saved is None:
                notices += _keep_damaged(found, place)
                found = replace(found, origin=origin)
                return _open_recovered(place, None, found, lock, notices)
        except LibraryMissing as error:
            notices += (str(error),)
        except BaseException:
            lock.release()
            raise
        lock.release()
    raise AssertionError("numbers do not end")


def _open_recovered(
    place: Path,
    path: Path | None,
    found: RecoveredSession,
    lock: SceneLock,
    notices: tuple[str, ...],
    *,
    quiet: bool = False,
) -> OpenedScene:
    history = found.history
    assert history is not None
    storage = SceneStorage(
        place, lock, path=path, known=found.known, saved=found.saved, origin=found.origin
    )
    storage.record_all(history)
    if not quiet:
        notices += (f"recovered the unsaved changes of {place.stem!r} and their history",)
    return OpenedScene(history, storage, notices)


def _keep_damaged(found: RecoveredSession | None, scene: Path) -> tuple[str, ...]:
    """Puts a damaged journal aside, and says so."""
    if found is None or not found.damage:
        return ()
    return (
        f"the journal of the last session is damaged ({found.damage}); the readable part is"
        f" recovered, and the journal is kept as {set_journal_aside(journal_path(scene))}",
    )


def _scene_folder(folder: str | Path | None) -> Path:
    """The folder for scenes.

    Raises:
        InvalidInputError: it is none.
    """
    path = Path.cwd() if folder is None else Path(folder)
    if not path.is_dir():
        raise InvalidInputError(f"{path} is not a folder; give one for the scenes")
    return path.resolve()
