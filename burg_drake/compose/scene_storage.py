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
    portable_reference,
    require_name,
    resolve_reference,
    shorten_text,
    try_lock,
)
from burg_drake.objects import LIBRARY_FILE, ObjectLibrary, load_library
from burg_drake.scene import Board, SceneDocument, load_scene


class FileChanged(InvalidInputError):
    """A file is not as the session left it; writing it would lose what somebody else wrote."""


class UnsavedChanges(InvalidInputError):
    """Going on would lose changes that are not in any file."""


def file_fingerprint(path: Path) -> str | None:
    """A hash of what a file holds; None if it is not there.

    Raises:
        InvalidInputError: it is there and cannot be read.
    """
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise InvalidInputError(f"cannot read {path}: {error.strerror or error}") from error


def scene_path(name: str, folder: Path) -> Path:
    """The file of a scene by its name, in a folder and nowhere else.

    Args:
        name: `breakfast` or `breakfast.yaml`.
        folder: that was opened.

    Raises:
        FieldError: it is not a name: it would lead elsewhere, or hide the file.
        InvalidInputError: there is a link of that name, which leads elsewhere.
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
    """Writes a scene file so that its library is found from there.

    Args:
        document: the scene.
        library: its library.
        path: the file.
        known: `file_fingerprint` that the file should have.
        force: writes it all the same.

    Returns:
        The document as it was written, and the file's fingerprint.

    Raises:
        FileChanged: the file has another fingerprint.
        InvalidInputError: it cannot be written; then it is as it was.
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
    """How a scene file in `folder` refers to its library: as the document does if that leads there,
    else by package:// or the relative path."""
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
        address: of its page; empty if it has not told.
    """

    def __init__(self, message: str, address: str) -> None:
        super().__init__(message)
        self.address = address


class SceneLock:
    """A lock that its holder's end releases, however that comes about.

    Where nothing can be written there is no lock, and nothing that it would protect.
    """

    def __init__(self, scene: Path, address: str = "") -> None:
        """Takes the lock.

        Args:
            scene: the scene's file, which need not be there.
            address: of the session's page.

        Raises:
            SceneInUse: another session has it.
        """
        self.path = scene.with_name(f".{scene.name}.lock")
        self._file = _lock_file(self.path, scene)
        self.announce(address)

    def announce(self, address: str) -> None:
        """Says where the session's page is."""
        if self._file is not None:
            with contextlib.suppress(OSError):  # a full disk
                os.ftruncate(self._file, 0)
                os.pwrite(self._file, address.encode(), 0)

    def release(self) -> None:
        """Lets others open the scene."""
        if self._file is not None:
            with contextlib.suppress(OSError):
                self.path.unlink(missing_ok=True)
            os.close(self._file)
            self._file = None


def _lock_file(path: Path, scene: Path) -> int | None:
    """The descriptor of the locked file."""
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
        os.close(file)  # its last holder has removed it meanwhile


class SceneStorage:
    """The files of one scene.

    Attributes:
        place: where the scene's file is, or would be if it had one.
        path: the scene's file; None if it has none.
        known: `file_fingerprint` that the file should have.
        saved: what it holds.
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
        """Says where the session's page is, for those who find the scene in use."""
        self._lock.announce(address)

    def record_step(self, history: History) -> None:
        """The history has one more step, and is there."""
        position = history.position
        self._append(lambda journal: journal.step(history.steps[position], position), history)

    def record_position(self, history: History) -> None:
        """The history is at another step."""
        self._append(lambda journal: journal.position(history.position), history)

    def record_all(self, history: History) -> None:
        """Writes the whole journal again, as the history is another one."""
        journal = JournalWriter()
        lines = [journal.begin(self._origin)]
        lines += [journal.step(step, position) for position, step in enumerate(history.steps)]
        lines += [journal.position(history.position), journal.saved(self.saved, self.known)]
        try:
            atomic_write(journal_path(self.place), "".join(lines))
        except InvalidInputError as error:
            self._journal, self.problem = None, str(error)
        else:
            self._journal, self.problem = journal, None

    def _append(self, line: Callable[[JournalWriter], str], history: History) -> None:
        """Adds a line to the journal. After an error all of it is written with the next line."""
        if self._journal is None:
            self.record_all(history)
            return
        path = journal_path(self.place)
        try:
            append_line(path, line(self._journal).encode())
        except OSError as error:
            self._journal = None
            self.problem = f"cannot write {path}: {error.strerror or error}"

    def _remove_journal(self) -> None:
        """All that it has is in the scene's file, or is not wanted."""
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
        """Lets others open the scene.

        Args:
            keep: the journal, as there is something in it that is in no file.
        """
        if not keep:
            self._remove_journal()
        self._lock.release()


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
