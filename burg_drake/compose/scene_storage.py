"""The files of a session's scene (document, lock and journal), and how scenes are opened."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

from burg_drake.compose.commands import board_size
from burg_drake.compose.journal import (
    JournalWriter,
    LibraryMissing,
    RecoveredSession,
    append_line,
    journal_path,
    recover_journal,
    set_journal_aside,
)
from burg_drake.compose.state import History, State
from burg_drake.core import (
    BurgError,
    InvalidInputError,
    UnknownNameError,
    atomic_write,
    builtin_names,
    data_root,
    document_text,
    name_or_reference,
    portable_reference,
    require_name,
    resolve_reference,
    shorten_text,
    try_lock,
)
from burg_drake.objects import LIBRARY_FILE, ObjectLibrary, load_library
from burg_drake.scene import Board, SceneDocument, load_scene


class FileChanged(InvalidInputError):
    """A file was changed by another program; writing it would lose those changes."""


class UnsavedChanges(InvalidInputError):
    """The operation would lose unsaved changes."""


def file_fingerprint(path: Path) -> str | None:
    """A hash of a file's content; None if there is no file.

    Raises:
        InvalidInputError: the file cannot be read.
    """
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise InvalidInputError(f"cannot read {path}: {error.strerror or error}") from error


def scene_path(name: str, folder: Path) -> Path:
    """The file of a scene by its name, always directly in the folder.

    Args:
        name: `breakfast` or `breakfast.yaml`.
        folder: the folder that was opened.

    Raises:
        FieldError: the name is invalid: it leads out of the folder, or gives a hidden file.
        InvalidInputError: a symbolic link of that name leads out of the folder.
    """
    stem = name.removesuffix(".yaml").removesuffix(".yml")
    require_name(stem)
    path = folder / f"{stem}.yaml"
    if path.is_symlink() and not path.resolve().is_relative_to(folder.resolve()):
        raise InvalidInputError(f"{path} is a link to another folder; choose another name")
    return path


def write_scene(
    document: SceneDocument, library: ObjectLibrary, path: Path, *, known: str | None, force: bool
) -> tuple[SceneDocument, str]:
    """Writes a scene file, with a reference to its library that is valid from its folder.

    Args:
        document: the scene.
        library: its library.
        path: the file.
        known: expected `file_fingerprint` of the existing file.
        force: write even if the fingerprint differs.

    Returns:
        The written document, and the file's new fingerprint.

    Raises:
        FileChanged: the file has another fingerprint.
        InvalidInputError: the file cannot be written; it keeps its old content.
    """
    found = file_fingerprint(path)
    if found not in (known, None) and not force:
        what = "exists already" if known is None else "was changed by another program"
        raise FileChanged(
            f"{path} {what}; overwrite it, save under another name, or load it to see what it holds"
        )
    written = replace(document, library=library_reference(document, library, path.parent))
    text = document_text(written)
    atomic_write(path, text)
    return written, hashlib.sha256(text.encode()).hexdigest()


def library_reference(document: SceneDocument, library: ObjectLibrary, folder: Path) -> str:
    """The reference to its library for a scene file in `folder`: that of the document if it is
    valid there, else package:// or the relative path."""
    if document.library in builtin_names("models"):
        return document.library
    try:
        if load_library(document.library, folder).root.resolve() == library.root.resolve():
            return document.library
    except (BurgError, OSError):
        pass
    return portable_reference(library.root, folder)


class SceneInUse(InvalidInputError):
    """A scene is open in another session.

    Attributes:
        address: address of the other session's page; empty if unknown.
    """

    def __init__(self, message: str, address: str) -> None:
        super().__init__(message)
        self.address = address


class SceneLock:
    """A lock on a scene, released even if its process is killed.

    In a read-only folder there is no lock, and no file that it would protect.
    """

    def __init__(self, scene: Path, address: str = "") -> None:
        """Takes the lock.

        Args:
            scene: the scene's file, which need not exist.
            address: address of the session's page.

        Raises:
            SceneInUse: another session holds the lock.
        """
        self.path = scene.with_name(f".{scene.name}.lock")
        self._file = _lock_file(self.path, scene)
        self.announce(address)

    def announce(self, address: str) -> None:
        """Writes the address of the session's page into the lock file."""
        if self._file is not None:
            with contextlib.suppress(OSError):  # a full disk
                os.ftruncate(self._file, 0)
                os.pwrite(self._file, address.encode(), 0)

    def release(self) -> None:
        """Releases the lock, so that others can open the scene."""
        if self._file is not None:
            with contextlib.suppress(OSError):
                self.path.unlink(missing_ok=True)
            os.close(self._file)
            self._file = None


def _lock_file(path: Path, scene: Path) -> int | None:
    """Locks a file; returns its descriptor."""
    while True:
        try:
            file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o666)
        except OSError:
            return None
        try:
            locked = try_lock(file)
        except OSError:  # a file system without locks
            return file
        if not locked:
            address = os.pread(file, 200, 0).decode(errors="replace")
            os.close(file)
            where = f" at {shorten_text(address, 200)}" if address else ""
            raise SceneInUse(
                f"{scene} is already open{where}; use it there, or close it first", address
            )
        with contextlib.suppress(OSError):
            if os.path.samestat(os.fstat(file), os.stat(path)):
                return file
        os.close(file)  # the last holder has removed the file meanwhile


class SceneStorage:
    """The files of one scene.

    Attributes:
        place: path for the scene's file, which may not exist yet.
        path: path of the existing file; None if the scene was never saved.
        known: expected `file_fingerprint` of the file.
        saved: the scene in the file.
        problem: why the last steps are not in the journal; None if they are.
    """

    def __init__(
        self,
        place: Path,
        lock: SceneLock,
        *,
        path: Path | None = None,
        known: str | None = None,
        saved: SceneDocument | None = None,
        origin: str = "",
    ) -> None:
        self.place, self.path, self.known, self.saved = place, path, known, saved
        self.problem: str | None = None
        self._lock, self._origin = lock, origin
        self._journal: JournalWriter | None = None  # a new journal is begun if None

    def announce(self, address: str) -> None:
        """Publishes the address of the session's page, for others who try to open the scene."""
        self._lock.announce(address)

    def record_step(self, history: History) -> None:
        """Writes the newest step of the history to the journal."""
        position = history.position
        self._append(lambda journal: journal.step_line(history.steps[position], position), history)

    def record_position(self, history: History) -> None:
        """Writes the position in the history to the journal."""
        self._append(lambda journal: journal.position_line(history.position), history)

    def record_all(self, history: History) -> None:
        """Writes the whole journal again, for another history."""
        journal = JournalWriter()
        lines = [journal.first_line(self._origin)]
        lines += [journal.step_line(step, position) for position, step in enumerate(history.steps)]
        lines += [
            journal.position_line(history.position),
            journal.saved_line(self.saved, self.known),
        ]
        try:
            atomic_write(journal_path(self.place), "".join(lines))
        except InvalidInputError as error:
            self._journal, self.problem = None, str(error)
        else:
            self._journal, self.problem = journal, None

    def _append(self, make_line: Callable[[JournalWriter], str], history: History) -> None:
        """Adds a line to the journal. After an error, the next call writes the whole journal."""
        if self._journal is None:
            self.record_all(history)
            return
        path = journal_path(self.place)
        try:
            append_line(path, make_line(self._journal).encode())
        except OSError as error:
            self._journal = None
            self.problem = f"cannot write {path}: {error.strerror or error}"

    def _remove_journal(self) -> None:
        """Deletes the journal, whose steps are saved or discarded."""
        self._journal = None
        with contextlib.suppress(OSError):
            journal_path(self.place).unlink(missing_ok=True)

    def save(self, history: History, name: str | None, folder: Path, *, overwrite: bool) -> None:
        """Writes the scene; the history gets its name. See `ComposeSession.save`."""
        state = history.state
        place = self.place if name is None else scene_path(name, folder)
        elsewhere = place != self.place
        lock = SceneLock(place) if elsewhere else self._lock
        try:
            known = None if elsewhere or self.path is None else self.known
            document = state.document
            if elsewhere or self.path is None:
                document = replace(document, name=place.stem)
            written, fingerprint = write_scene(
                document, state.library, place, known=known, force=overwrite
            )
        except BaseException:
            if elsewhere:
                lock.release()
            raise
        if elsewhere:
            self._remove_journal()
            self._lock.release()
            self._lock, self.place = lock, place
        history.rename(written.name, written.library, state.library)
        self.path, self.known, self.saved = place, fingerprint, written
        self._origin = ""
        self.record_all(history)

    def close(self, *, keep: bool) -> None:
        """Releases the scene, so that others can open it.

        Args:
            keep: whether to keep the journal, as it holds unsaved changes.
        """
        if not keep:
            self._remove_journal()
        self._lock.release()


@dataclass(frozen=True)
class OpenedScene:
    """An opened scene.

    Attributes:
        history: history with the scene's state, and the earlier steps of a recovered session.
        storage: files of the scene.
        notices: texts for the user, one line each.
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
    """Opens a scene's file, or the unsaved changes that a killed session left of it.

    Raises:
        SceneInUse: the scene is open in another session.
        UnknownNameError: there is no such file, or an instance's object is unknown.
        DocumentError: the file does not fit the schema.
    """
    lock = SceneLock(path, address)
    try:
        found = recover_journal(journal_path(path))
        notices = _set_damaged_aside(found, path)
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
    """A new scene with an empty A3 board in landscape, for the objects of a library."""
    loaded = load_library(library)
    reference = name_or_reference(library, "models", loaded.root, folder)

    def make_state(name: str) -> State:
        board = Board(size=board_size("A3"))
        return State(SceneDocument(name=name, library=reference, board=board), loaded)

    return _open_unsaved_scene("new_scene", make_state, folder, reference, address)


def _open_built_in_scene(path: Path, folder: Path, address: str) -> OpenedScene:
    """A new scene that starts as a copy of a built-in one."""
    scene = load_scene(path)

    def make_state(name: str) -> State:
        return State(replace(scene.document, name=name), scene.library)

    return _open_unsaved_scene(scene.name, make_state, folder, f"scene {path.stem}", address)


def _open_unsaved_scene(
    name: str, make_state: Callable[[str], State], folder: Path, origin: str, address: str
) -> OpenedScene:
    """A scene without a file, under the first unused name of `name`, `name_2` and so on.

    Recovers the unsaved changes of a session with the same origin.
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
            first = make_state(place.stem)
            if found is None or found.history is None:
                notices += _set_damaged_aside(found, place)
                return OpenedScene(
                    History(first), SceneStorage(place, lock, origin=origin), notices
                )
            same_library = found.history.state.library.root == first.library.root
            lost_origin = not found.origin and bool(found.damage) and same_library
            if (found.origin == origin or lost_origin) and found.saved is None:
                notices += _set_damaged_aside(found, place)
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


def _set_damaged_aside(found: RecoveredSession | None, scene: Path) -> tuple[str, ...]:
    """Sets a damaged journal aside; returns the notice about it."""
    if found is None or not found.damage:
        return ()
    return (
        f"the journal of the last session is damaged ({found.damage}); the readable part is"
        f" recovered, and the journal is kept as {set_journal_aside(journal_path(scene))}",
    )


def _scene_folder(folder: str | Path | None) -> Path:
    """The folder for scenes; the working directory if None.

    Raises:
        InvalidInputError: there is no such folder.
    """
    path = Path.cwd() if folder is None else Path(folder)
    if not path.is_dir():
        raise InvalidInputError(f"{path} is not a folder; give one for the scenes")
    return path.resolve()
