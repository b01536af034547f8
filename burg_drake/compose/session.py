"""A session: a scene that is being composed, by commands, from one or several pages."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

from burg_drake.compose.command import Command, label_of
from burg_drake.compose.drag import Drag
from burg_drake.compose.history import History, Step
from burg_drake.compose.moving import Move
from burg_drake.compose.opening import Opened, open_reference, open_scene_file
from burg_drake.compose.scene_file import UnsavedChanges, scene_path, write_scene
from burg_drake.compose.state import State, require_some
from burg_drake.compose.surroundings import Surroundings
from burg_drake.compose.view import View, status_of
from burg_drake.core.errors import BurgError, InvalidInputError
from burg_drake.scene.scene import SceneDocument
from burg_drake.scene.validate import SceneIssue
from burg_drake.station.station import Station

Callback = Callable[[View], None]


class ComposeSession:
    """Document, selection, commands and history of one scene, without any user interface.

    All methods may be called from any thread. What is refused raises a `BurgError`, and changes
    nothing.

    Attributes:
        station: where the scene stands.
        folder: scenes are saved to and loaded from here, and nowhere else.
    """

    def __init__(self, opened: Opened, station: Station, folder: Path) -> None:
        self.station = station
        self.folder = folder
        self._lock = threading.RLock()
        self._callbacks: list[Callback] = []
        self._drag: Drag | None = None
        self._planar = True
        self._serial = self._revision = 0
        self._notices: tuple[str, ...] = ()
        self._path: Path | None
        self._known: str | None
        self._saved: SceneDocument | None
        self._state: State
        self._history: History
        self._view: View
        self._begin(opened)

    @classmethod
    def open(
        cls, reference: str | Path, station: Station, *, folder: str | Path | None = None
    ) -> ComposeSession:
        """Opens a scene, or begins a new one with the objects of a library.

        Args:
            reference: of a scene (path or built-in name) or a library (folder or built-in name). A
                built-in scene is the start of a new one: it has no file until it is saved.
            station: where it stands.
            folder: for scenes; that of the scene's file, or the working directory, if None.

        Raises:
            UnknownNameError: there is neither, or an instance's object is unknown.
            DocumentError: the file does not fit the schema.
        """
        opened = open_reference(reference)
        if folder is None:
            folder = Path.cwd() if opened.path is None else opened.path.parent
        return cls(opened, station, Path(folder).resolve())

    @property
    def view(self) -> View:
        """What there is to see now."""
        with self._lock:
            return self._view

    def on_change(self, callback: Callback) -> Callable[[], None]:
        """Calls `callback` with each new view, in the thread that caused it; see `View.serial`.

        Returns:
            What ends that.
        """
        with self._lock:
            self._callbacks.append(callback)

        def unsubscribe() -> None:
            with self._lock:
                if callback in self._callbacks:
                    self._callbacks.remove(callback)

        return unsubscribe

    def do(self, command: Command) -> View:
        """Takes a step; none if the command changes nothing.

        Raises:
            BurgError: it cannot be taken; one clear line says why.
        """
        with self._lock:
            state = command.apply(self._state, self._surroundings)
            self._drag = None
            return self._take(Step(command.label, state))

    def undo(self) -> View:
        """Takes the last step back, and selects what it had changed.

        Raises:
            InvalidInputError: there is none.
        """
        with self._lock:
            self._drag = None
            return self._show(self._history.undo(), changed=True)

    def redo(self) -> View:
        """Takes the step again that was undone last.

        Raises:
            InvalidInputError: there is none.
        """
        with self._lock:
            self._drag = None
            return self._show(self._history.redo(), changed=True)

    def select(self, names: Iterable[str]) -> View:
        """Selects instances, and no others; this is no step.

        Raises:
            UnknownNameError: one is not there.
        """
        with self._lock:
            return self._show(self._state.select(names), changed=False)

    def restrict_movement(self, planar: bool) -> View:
        """Whether what is moved from now on keeps its height and tilt."""
        with self._lock:
            self._planar = planar
            return self._publish(self._view.issues)

    def notify(self, notice: str) -> View:
        """Adds a line to what the user should know."""
        with self._lock:
            if notice not in self._notices:
                self._notices += (notice,)
            return self._publish(self._view.issues)

    def dismiss(self, notice: str) -> View:
        """The user has read a notice."""
        with self._lock:
            self._notices = tuple(n for n in self._notices if n != notice)
            return self._publish(self._view.issues)

    # --- dragging -------------------------------------------------------------------------------

    def drag(self, names: Iterable[str]) -> Drag:
        """Takes instances in the hand; they are selected. A drag that is not over yet is put back.

        Raises:
            UnknownNameError: one is not there.
        """
        with self._lock:
            if self._drag is not None:
                self.put_back(self._drag)
            held = require_some(names, self._state)
            self.select(held)
            self._drag = Drag(self, held, self._view)
            return self._drag

    def holds(self, drag: Drag) -> bool:
        """Whether a drag is not over."""
        with self._lock:
            return self._drag is drag

    def preview(self, drag: Drag, move: Move) -> View:
        """Shows what is dragged elsewhere; see `Drag.move`.

        Raises:
            InvalidInputError: a pose is none, or the drag is over.
        """
        with self._lock:
            self._require(drag)
            start = self._history.state.select(drag.names)
            self._state = move.apply(start, self._surroundings)
            return self._publish(self._issues())

    def drop(self, drag: Drag) -> View:
        """Makes a drag a step; see `Drag.end`."""
        with self._lock:
            self._require(drag)
            self._drag = None
            return self._take(Step(label_of("move", drag.names), self._state))

    def put_back(self, drag: Drag) -> View:
        """Ends a drag without a step; see `Drag.cancel`."""
        with self._lock:
            if not self.holds(drag):
                return self._view
            self._drag = None
            return self._show(self._history.state.select(drag.names), changed=False)

    # --- files ----------------------------------------------------------------------------------

    def save(self, name: str | None = None, *, overwrite: bool = False) -> View:
        """Writes the scene to its file, or to another one in the folder, which is its file then.

        Args:
            name: of the file, which is the scene's name then; its own if None.
            overwrite: also a file that something else has changed, or another scene.

        Raises:
            FileChanged: the file is not as this session knows it.
            InvalidInputError: it cannot be written: the old file is as it was.
        """
        with self._lock:
            state = self._history.state
            path = self._path
            if name is not None or path is None:
                path = scene_path(name or state.document.name, self.folder)
            document = state.document
            if path != self._path:
                document = replace(document, name=path.stem)
            known = self._known if path == self._path else None
            written, fingerprint = write_scene(
                document, state.library, path, known=known, force=overwrite
            )
            self._path, self._known = path, fingerprint
            self._history.rewrite(written.name, written.library)
            self._saved = self._history.state.document
            return self._show(
                replace(self._history.state, selection=self._state.selection), changed=False
            )

    def load(self, name: str | None = None, *, discard: bool = False) -> View:
        """Opens another scene of the folder, or its own file again; the history begins anew.

        Args:
            name: of the file; its own if None.
            discard: changes that were not saved.

        Raises:
            UnsavedChanges: there are such.
            InvalidInputError: the scene has no file, or the name would lead elsewhere.
            BurgError: the file cannot be read, or does not fit.
        """
        with self._lock:
            if name is None and self._path is None:
                raise InvalidInputError("this scene was never saved, so there is nothing to load")
            path = self._path if name is None else scene_path(name, self.folder)
            assert path is not None
            if not self._view.saved and not discard:
                raise UnsavedChanges(
                    f"scene {self._state.document.name!r} has changes that are not saved; save or"
                    " discard them"
                )
            self._begin(open_scene_file(path))
            return self._view

    # --- inside ---------------------------------------------------------------------------------

    def _begin(self, opened: Opened) -> None:
        self._drag = None
        self._path, self._known = opened.path, opened.known
        self._history = History(opened.state)
        self._saved = None if opened.path is None else opened.state.document
        self._state = opened.state
        self._revision += 1
        self._publish(self._issues())

    @property
    def _surroundings(self) -> Surroundings:
        path = self._path or self.folder / f"{self._history.state.document.name}.yaml"
        return Surroundings(self.station, self._planar, path)

    def _take(self, step: Step) -> View:
        before = self._history.state
        if step.state.document == before.document and step.state.library == before.library:
            return self._show(step.state, changed=False)
        self._history.add(step)
        return self._show(step.state, changed=True)

    def _show(self, state: State, *, changed: bool) -> View:
        moved = state.document is not self._state.document
        self._state = state
        self._revision += changed
        return self._publish(self._issues() if changed or moved else self._view.issues)

    def _issues(self) -> tuple[SceneIssue, ...]:
        from burg_drake.station.check import check_scene

        try:
            return check_scene(self._state.scene(self._surroundings.path), self.station)
        except BurgError as error:
            notice = f"the scene cannot be checked: {error}"
            if notice not in self._notices:
                self._notices += (notice,)
            return ()

    def _publish(self, issues: tuple[SceneIssue, ...]) -> View:
        self._serial += 1
        self._view = view = View(
            serial=self._serial,
            revision=self._revision,
            state=self._state,
            issues=issues,
            status=status_of(self._state, issues),
            undo_label=self._history.undo_label,
            redo_label=self._history.redo_label,
            saved=self._history.state.document == self._saved,
            path=self._path,
            planar=self._planar,
            dragging=self._drag.names if self._drag else (),
            notices=self._notices,
        )
        for callback in tuple(self._callbacks):
            callback(view)
        return view

    def _require(self, drag: Drag) -> None:
        if self._drag is not drag:
            raise InvalidInputError(
                "the drag is over: something else changed the scene; drag again"
            )
