"""Applies commands to a scene, keeps the history and the selection, and publishes views."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.compose.commands import Command, command_label
from burg_drake.compose.moving_commands import MoveObjects
from burg_drake.compose.scene_checker import SceneChecker, Surroundings
from burg_drake.compose.scene_storage import OpenedScene, SceneStorage
from burg_drake.compose.session_view import SessionView, instance_statuses
from burg_drake.compose.state import (
    History,
    HistoryStep,
    State,
    StepAmendment,
    require_instance_names,
)
from burg_drake.core import Array, BurgError, InvalidInputError, make_pose, rot_z
from burg_drake.scene import SceneIssue
from burg_drake.station import StationLike, as_station


class Drag:
    """A drag of instances, begun by `ComposeSession.drag`.

    `move` may be called from several threads, and faster than a scene is checked: then only the
    newest poses are checked, and older calls return the latest view.

    Attributes:
        names: dragged instances.
    """

    def __init__(self, session: Editor, names: tuple[str, ...], start: SessionView) -> None:
        self.names = names
        self._session = session
        self._start = {name: start.X_SO(name) for name in names}
        self._move = MoveObjects(self._start)
        self._last_requested = self._last_checked = 0
        self._move_lock = threading.Lock()
        self._check_lock = threading.Lock()

    @property
    def is_over(self) -> bool:
        """Whether the drag was ended or cancelled, or another change of the scene ended it."""
        return self._session._drag is not self

    def move(self, X_SO: Mapping[str, ArrayLike], *, changes_height: bool = False) -> SessionView:
        """Moves dragged instances to poses.

        Args:
            X_SO: (4, 4) poses by name, of all dragged instances or of some.
            changes_height: Heights change even while objects are kept upright.

        Returns:
            The scene with the instances moved, and the status of all instances.

        Raises:
            InvalidInputError: a pose is invalid, an instance is not dragged, or the drag is over.
        """
        for name in X_SO:
            if name not in self._start:
                raise InvalidInputError(
                    f"{name!r} is not part of this drag; start a drag that includes it"
                )
        with self._move_lock:
            self._move = MoveObjects({**self._move.X_SO, **X_SO}, changes_height)
            self._last_requested += 1
            number = self._last_requested
        with self._check_lock:
            with self._move_lock:
                if number <= self._last_checked:  # newer poses were checked while this call waited
                    return self._session.view
                self._last_checked, move = self._last_requested, self._move
            session = self._session
            with session._exclusive():
                self._require_current()
                return session._show(move.apply(session._history.state, session._surroundings))

    def move_by(self, offset: tuple[float, float, float], yaw: float = 0.0) -> SessionView:
        """Moves all dragged instances together, relative to their poses at the start.

        Args:
            offset: along x, y and z of the scene [m].
            yaw: about the vertical through the mean of their origins [rad].
        """
        middle = np.mean([X[:3, 3] for X in self._start.values()], axis=0)
        return self.transform(make_pose(rot_z(yaw), middle + offset) @ make_pose(p_AB=-middle))

    def transform(self, X: Array, *, changes_height: bool = False) -> SessionView:
        """Applies a motion (4, 4) in S to the start poses of all dragged instances; see
        `move`."""
        X_SO = {name: X @ X_SOi for name, X_SOi in self._start.items()}
        return self.move(X_SO, changes_height=changes_height)

    def end(self) -> SessionView:
        """Ends the drag and adds one step to the history, or none if nothing moved."""
        session = self._session
        with session._exclusive():
            self._require_current()
            session._drag = None
            state = replace(session._state, library=session._history.state.library)
            return session._edit(command_label("move", self.names), state)

    def cancel(self) -> SessionView:
        """Puts the instances back to their start poses."""
        session = self._session
        with session._exclusive():
            if self.is_over:
                return session.view
            session._drag = None
            return session._show(session._history.state.select(self.names))

    def _require_current(self) -> None:
        if self.is_over:
            raise InvalidInputError(
                "the scene was changed during the drag, which ended it; drag again"
            )


Callback = Callable[[SessionView], None]


class Editor:
    """The part of `ComposeSession` that needs neither other files nor other processes.

    Args:
        opened: the scene.
        station: station of the scene.
    """

    def __init__(self, opened: OpenedScene, station: StationLike) -> None:
        self.station = as_station(station)
        self._lock = threading.RLock()
        self._depth = 0
        self._callbacks: list[Callback] = []
        self._last_reported = 0
        self._checker = SceneChecker(self.station)
        self._amendment = StepAmendment()
        self._planar = True
        self._serial = self._revision = 0
        self._notices: tuple[str, ...] = ()
        self._dismissed: set[str] = set()
        self._check_problem: str | None = None
        self._history: History
        self._storage: SceneStorage
        self._state: State
        self._drag: Drag | None
        self._view: SessionView
        with self._exclusive():
            self._begin(opened)

    @property
    def view(self) -> SessionView:
        """The current view."""
        return self._view

    def on_change(self, callback: Callback) -> Callable[[], None]:
        """Calls `callback` with each new view, in the thread that caused it; if several views come
        at once, with the last only. With several threads they may come out of order: see
        `SessionView.serial`.

        Returns:
            A function that ends the calls.
        """
        with self._lock:
            self._callbacks.append(callback)

        def unsubscribe() -> None:
            with self._lock:
                if callback in self._callbacks:
                    self._callbacks.remove(callback)

        return unsubscribe

    def do(self, command: Command, *, field: str = "") -> SessionView:
        """Applies a command and adds a step to the history, unless it changes nothing.

        Args:
            command: command to apply.
            field: name of the field that the user types in. The step replaces the last step if
                that is recent and of the same field, and nothing was selected since.

        Raises:
            BurgError: the command cannot be applied; its one-line message says why.
        """
        with self._exclusive():
            self._update_surroundings()
            selected = replace(self._history.state, selection=self._state.selection)
            state = command.apply(selected, self._surroundings)
            self._drag = None
            return self._edit(command.label, state, field)

    def undo(self) -> SessionView:
        """Undoes the last step, and selects the instances that it had changed.

        Raises:
            InvalidInputError: there is nothing to undo.
        """
        return self._go_to_step(lambda: self._history.undo())

    def redo(self) -> SessionView:
        """Redoes the step that was undone last.

        Raises:
            InvalidInputError: there is nothing to redo.
        """
        return self._go_to_step(lambda: self._history.redo())

    def select(self, names: Iterable[str]) -> SessionView:
        """Selects these instances only; adds no step to the history.

        Raises:
            UnknownNameError: there is no such instance.
        """
        with self._exclusive():
            self._amendment.end()
            return self._show(self._state.select(names))

    def restrict_movement(self, planar: bool) -> SessionView:
        """Sets whether moved objects keep their tilt, and their height unless they are raised."""
        with self._exclusive():
            self._planar = planar
            return self._publish()

    def notify(self, notice: str) -> SessionView:
        """Adds a notice for the user, one line."""
        with self._exclusive():
            if notice not in self._notices:
                self._notices += (notice,)
            return self._publish()

    def dismiss(self, notice: str) -> SessionView:
        """Removes a notice that the user has read."""
        with self._exclusive():
            self._notices = tuple(n for n in self._notices if n != notice)
            self._dismissed.add(notice)
            return self._publish()

    def drag(self, names: Iterable[str]) -> Drag:
        """Begins to drag instances, and selects them. Cancels a drag that is not over yet.

        Raises:
            InvalidInputError: no instance is given.
            UnknownNameError: there is no such instance.
        """
        with self._exclusive():
            held = require_instance_names(names, self._history.state)
            self._drag = None
            self._show(self._history.state.select(held))
            self._drag = Drag(self, held, self._view)
            self._publish()
            return self._drag

    def _begin(self, opened: OpenedScene) -> None:
        """Starts with another scene, which has its own history."""
        self._drag = None
        self._history, self._storage = opened.history, opened.storage
        self._notices = opened.notices
        self._dismissed.clear()
        self._state = self._history.state
        self._revision += 1
        self._publish()

    def _update_surroundings(self) -> None:
        """Called before each step: handles changes of files outside the session."""

    def _add_task_state(self, view: SessionView) -> SessionView:
        """The view, completed with the state of background tasks."""
        return view

    @property
    def _surroundings(self) -> Surroundings:
        return Surroundings(self.station, self._planar, self._storage.place, self._checker)

    @property
    def _has_unsaved_changes(self) -> bool:
        """Whether there are unsaved changes."""
        if self._storage.saved is None:
            return self._history.position > 0
        return self._history.state.document != self._storage.saved

    @contextlib.contextmanager
    def _exclusive(self) -> Iterator[None]:
        """Keeps other threads out; calls the listeners after the lock is released."""
        view: SessionView | None = None
        try:
            with self._lock:
                self._depth += 1
                try:
                    yield
                finally:
                    self._depth -= 1
                    if self._depth == 0 and self._serial != self._last_reported:
                        view, self._last_reported = self._view, self._serial
                        callbacks = tuple(self._callbacks)
        finally:
            if view is not None:
                for callback in callbacks:
                    try:
                        callback(view)
                    except Exception:  # a failing listener must not affect the step
                        logging.getLogger(__name__).exception("a listener of a session failed")

    def _edit(self, label: str, state: State, field: str = "") -> SessionView:
        """Adds a step; the scene then no longer counts as sampled."""
        document = state.document
        if document != self._history.state.document and document.origin is not None:
            state = replace(state, document=replace(document, origin=None))
        if self._amendment.allows(field, self._history):
            label = self._history.undo_label or label
            self._history.undo()
            self._storage.record_position(self._history)
            self._revision += 1
        step = HistoryStep(label, state)
        self._amendment.begin(field, step)
        return self._add_step(step)

    def _add_step(self, step: HistoryStep) -> SessionView:
        before = self._history.state
        if step.state.document == before.document and step.state.library is before.library:
            return self._show(step.state)
        self._history.add(step)
        self._storage.record_step(self._history)
        self._revision += 1
        return self._show(step.state)

    def _go_to_step(self, get_state: Callable[[], State]) -> SessionView:
        with self._exclusive():
            state = get_state()
            self._drag = None
            self._amendment.end()
            self._storage.record_position(self._history)
            self._revision += 1
            return self._show(state)

    def _show(self, state: State) -> SessionView:
        self._state = state
        return self._publish()

    def _issues(self) -> tuple[SceneIssue, ...] | None:
        self._check_problem = None
        try:
            return self._checker.issues(self._state, self._storage.place)
        except BurgError as error:
            self._check_problem = f"the scene cannot be checked: {error}"
            return None

    def _gaps(self) -> dict[str, float]:
        try:
            return self._checker.gaps(self._state, self._storage.place)
        except BurgError:
            return {}  # `_issues` reports the error

    def _publish(self) -> SessionView:
        self._serial += 1
        issues = self._issues()
        self._view = self._add_task_state(
            SessionView(
                serial=self._serial,
                revision=self._revision,
                state=self._state,
                issues=issues or (),
                status=instance_statuses(self._state, issues),
                undo_label=self._history.undo_label,
                redo_label=self._history.redo_label,
                saved=self._history.state.document == self._storage.saved,
                changed=self._has_unsaved_changes,
                path=self._storage.path,
                planar=self._planar,
                gaps=self._gaps(),
                dragging=self._drag.names if self._drag else (),
                notices=self._all_notices(),
            )
        )
        return self._view

    def _all_notices(self) -> tuple[str, ...]:
        journal = self._storage.problem
        problems = (
            self._check_problem,
            journal and f"{journal}; until then changes are kept in memory only",
        )
        return self._notices + tuple(t for t in problems if t and t not in self._dismissed)


DragOwner = Editor  # A drag's session.
