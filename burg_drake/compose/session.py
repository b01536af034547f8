"""A session: one scene that one or several pages edit by commands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from burg_drake.compose.background_tasks import (
    BackgroundJob,
    BackgroundWorker,
    GraspCountJob,
    GraspWatch,
    SettlingProposal,
    SettlingTask,
)
from burg_drake.compose.commands import UseLibrary
from burg_drake.compose.editor import Editor
from burg_drake.compose.scene_checker import (
    missing_objects,
    restore_missing_objects,
    scene_of_known_objects,
)
from burg_drake.compose.scene_storage import (
    OpenedScene,
    UnsavedChanges,
    file_fingerprint,
    new_scene,
    open_reference,
    open_scene_file,
    scene_path,
)
from burg_drake.compose.session_view import SessionView
from burg_drake.compose.state import HistoryStep, State
from burg_drake.core import (
    BurgError,
    InvalidInputError,
    TaskCancelled,
    UnknownNameError,
    builtin_names,
    list_names,
    name_or_reference,
    suggest_names,
)
from burg_drake.objects import LIBRARY_FILE, ObjectLibrary, load_library
from burg_drake.scene import load_scene
from burg_drake.station import StationLike

if TYPE_CHECKING:
    from burg_drake.evaluation import GraspCount
    from burg_drake.printout import Printout, PrintSettings


def library_change_notice(state: State, library: ObjectLibrary) -> str:
    """One line on the effects of a changed library on a scene."""
    missing = missing_objects(replace(state, library=library))
    used = dict.fromkeys(instance.object for instance in state.instances.values())
    other = [
        name
        for name in used
        if name in library.objects and library.content[name] != state.library.content.get(name)
    ]
    parts = []
    if missing:
        parts.append(f"it no longer has the objects of {list_names(missing)}")
    if other:
        parts.append(f"{list_names(other)} {'was' if len(other) == 1 else 'were'} built again")
    return f"library {library.root} has changed: {'; '.join(parts) or 'no object of this scene'}"


def _library_stamp(root: Path) -> tuple[int, int, int] | None:
    """Time, size and inode of a library's document, to detect changes; None if it is missing."""
    try:
        stat = (root / LIBRARY_FILE).stat()
    except OSError:
        return None
    return stat.st_mtime_ns, stat.st_size, stat.st_ino


class ComposeSession(Editor):
    """Document, selection, commands and history of one scene, without any user interface.

    All methods may be called from any thread. A method that raises a `BurgError` changes nothing.
    Each step is written to a journal beside the scene, from which a killed session is recovered
    with its history.

    Attributes:
        station: station of the scene.
        folder: the only folder that scenes are saved to and loaded from.
    """

    def __init__(
        self, opened: OpenedScene, station: StationLike, folder: Path, address: str = ""
    ) -> None:
        self.folder = folder
        self._address = address
        self._seen_library: tuple[Path, object] | None = None
        self._seen_fingerprint: str | None = opened.storage.known
        self._settler = BackgroundWorker()
        self._settling: BackgroundJob[SettlingProposal] | None = None
        self._proposal: SettlingProposal | None = None
        self._grasp_watch: GraspWatch | None = None
        self._grasps: tuple[Mapping[str, GraspCount], int] = ({}, 0)
        super().__init__(opened, station)
        self.refresh()

    @classmethod
    def open(
        cls,
        reference: str | Path,
        station: StationLike,
        *,
        folder: str | Path | None = None,
        address: str = "",
    ) -> ComposeSession:
        """Opens a scene, or begins a new one with the objects of a library.

        Unsaved changes of a killed session are recovered, with a notice.

        Args:
            reference: a scene (path or built-in name) or a library (folder or built-in name). A
                built-in scene is copied to a new one, which has no file until it is saved.
            station: station of the scene.
            folder: folder for scenes; that of the scene's file, or the working directory, if None.
            address: address of the page, for others who try to open the scene; see `announce`.

        Raises:
            SceneInUse: the scene is open in another session; the error has its address.
            UnknownNameError: there is no such scene or library, or an instance's object is
                unknown.
            DocumentError: the file does not fit the schema.
        """
        opened = open_reference(reference, folder, address)
        place = opened.storage.place.parent if folder is None else Path(folder)
        return cls(opened, station, place.resolve(), address)

    def __enter__(self) -> ComposeSession:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def announce(self, address: str) -> None:
        """Publishes the address of the session's page, for others who try to open the scene."""
        with self._lock:
            self._address = address
            self._storage.announce(address)

    def close(self) -> None:
        """Closes the session, so that others can open the scene. Unsaved changes stay in the
        journal, and are recovered when the scene is opened again."""
        self.watch_grasps(None)
        self._settler.close()
        with self._exclusive():
            self._callbacks.clear()
            self._storage.close(keep=self._has_unsaved_changes)

    def save(self, name: str | None = None, *, overwrite: bool = False) -> SessionView:
        """Saves the scene to its file, or under another name, which then becomes its own.

        Args:
            name: new name of the scene and its file in the folder; None to keep the name.
            overwrite: replace the file even if another program changed it, or it is another
                scene.

        Raises:
            FileChanged: another program changed the file.
            SceneInUse: the scene of that name is open in another session.
            InvalidInputError: the file cannot be written; file and session stay unchanged.
        """
        with self._exclusive():
            self._storage.save(self._history, name, self.folder, overwrite=overwrite)
            self._storage.announce(self._address)
            selection = self._state.selection
            self._drag = None
            return self._show(replace(self._history.state, selection=selection))

    def load(self, name: str | None = None, *, discard: bool = False) -> SessionView:
        """Loads a scene of the folder. Reloading the own file is a step, which can be undone;
        another scene starts a new history.

        Args:
            name: name of the file; None for the scene's own file.
            discard: discard unsaved changes.

        Raises:
            UnsavedChanges: there are unsaved changes.
            SceneInUse: the scene is open in another session.
            InvalidInputError: the scene has no file, or the name leads out of the folder.
            BurgError: the file cannot be read, or is invalid.
        """
        with self._exclusive():
            path = self._storage.path if name is None else scene_path(name, self.folder)
            if path is None:
                raise InvalidInputError("this scene was never saved, so it cannot be loaded")
            self._require_saved(discard=discard)
            if path != self._storage.path:
                return self._switch_scene(open_scene_file(path, self._address))
            known = file_fingerprint(path)
            scene = load_scene(path)
            self._drag = None
            self._add_step(HistoryStep(f"load {path.name}", State(scene.document, scene.library)))
            self._storage.known, self._storage.saved = known, scene.document
            self._storage.record_all(self._history)
            return self._publish()

    def new(self, library: str | Path | None = None, *, discard: bool = False) -> SessionView:
        """Begins another scene with an empty board.

        Args:
            library: see `use_library`; that of this scene if None.
            discard: discard unsaved changes.

        Raises:
            UnsavedChanges: there are unsaved changes.
            UnknownNameError: there is no such library.
            DocumentError: its document does not fit the schema.
        """
        with self._exclusive():
            self._require_saved(discard=discard)
            reference = (
                self._history.state.library.root if library is None else self._library_path(library)
            )
            if library is None and self._history.state.document.library in builtin_names("models"):
                reference = self._history.state.document.library
            return self._switch_scene(new_scene(reference, self.folder, self._address))

    def printout(self, settings: PrintSettings | None = None) -> Printout:
        """PDF of the board with the current scene; see `printout.print_board`.

        Raises:
            InvalidInputError: the settings or the markers do not fit the board.
        """
        from burg_drake.printout import print_board

        return print_board(
            scene_of_known_objects(self._history.state, self._storage.place), settings
        )

    def libraries(self) -> tuple[str, ...]:
        """References of the libraries that a page may offer: built-in ones, and subfolders of the
        opened folder."""
        try:
            own = sorted(p.parent.name for p in self.folder.glob(f"*/{LIBRARY_FILE}"))
        except OSError:
            own = []
        return (*builtin_names("models"), *(name for name in own if not name.startswith(".")))

    def use_library(self, reference: str | Path) -> SessionView:
        """Takes the objects from another library; adds a step.

        Args:
            reference: one of `libraries`, or any folder as a `Path`.

        Raises:
            UnknownNameError: there is no such library, or it lacks objects of the scene.
            DocumentError: its document does not fit the schema.
        """
        library = load_library(self._library_path(reference))
        written = name_or_reference(reference, "models", library.root, self.folder)
        return self.do(UseLibrary(library, written))

    def _library_path(self, reference: str | Path) -> str | Path:
        """The path of one of `libraries`. A `Path` is returned as it is: pages pass strings only.

        Raises:
            UnknownNameError: there is no such library.
        """
        if isinstance(reference, Path):
            return self.folder / reference
        if reference not in self.libraries():
            raise UnknownNameError(
                f"{reference!r} is neither a library of this folder nor built in;"
                f" {suggest_names(reference, self.libraries())}"
            )
        return reference if reference in builtin_names("models") else self.folder / reference

    def refresh(self) -> SessionView:
        """Checks whether the library or the scene's file has changed on disk, and adds notices.
        Each step does that first."""
        with self._exclusive():
            self._update_surroundings()
            return self._view

    def settle(self, *, time_limit: float = 10.0) -> BackgroundJob[SettlingProposal]:
        """Settles the scene in a worker process, while editing goes on.

        The result becomes `SessionView.proposal`. An earlier job is cancelled.

        Args:
            time_limit: simulated time allowed [s].
        """
        with self._exclusive():
            self._drop_settling()
            scene = scene_of_known_objects(self._history.state, self._storage.place)
            self._settling = self._settler.submit(
                SettlingTask(scene, self.station, time_limit), self._on_settling_change
            )
            self._publish()
            return self._settling

    def accept(self, proposal: SettlingProposal | None = None) -> SessionView:
        """Accepts a settling proposal; adds a step.

        Args:
            proposal: the proposal to accept; that of the view if None.

        Raises:
            InvalidInputError: there is no proposal, or the scene has changed since then.
        """
        with self._exclusive():
            proposal = proposal or self._proposal
            if proposal is None:
                raise InvalidInputError("there is no proposal to accept; settle the scene first")
            before = self._history.state
            if scene_of_known_objects(before, self._storage.place).document != proposal.start:
                raise InvalidInputError(
                    "the scene has changed since it was settled; settle it again, or undo"
                )
            self._proposal = None
            self._drag = None
            state = replace(before, document=restore_missing_objects(proposal.document, before))
            moved = [n for n, i in state.instances.items() if i != before.instance(n)]
            return self._edit(proposal.label, state.select(moved))

    def revert(self) -> SessionView:
        """Drops the proposal, and cancels settling."""
        with self._exclusive():
            self._drop_settling()
            return self._publish()

    def watch_grasps(self, grasps_per_object: int | None = 50) -> SessionView:
        """Counts grasps in a worker process shortly after each change: how many of each object are
        clear and reachable, and what is in the way of the others. The counts are in
        `SessionView.grasps`.

        Args:
            grasps_per_object: grasps that are sampled for each object; None stops counting.
        """
        with self._exclusive():
            watch, self._grasp_watch = self._grasp_watch, None
            if grasps_per_object is not None:
                self._grasp_watch = GraspWatch(self.station, grasps_per_object, self._on_counts)
            view = self._publish()
        if watch is not None:
            watch.close()
        return view

    def _switch_scene(self, opened: OpenedScene) -> SessionView:
        """Switches to another scene."""
        self._drop_settling()
        self._storage.close(keep=False)
        self._seen_fingerprint = opened.storage.known
        self._begin(opened)
        return self.refresh()

    def _require_saved(self, *, discard: bool) -> None:
        if self._has_unsaved_changes and not discard:
            name = self._history.state.document.name
            raise UnsavedChanges(f"scene {name!r} has unsaved changes; save or discard them")

    def _update_surroundings(self) -> None:
        self._check_scene_file()
        library = self._history.state.library
        seen, self._seen_library = self._seen_library, (library.root, _library_stamp(library.root))
        if seen is None or seen[0] != library.root or seen == self._seen_library:
            return
        try:
            changed = load_library(library.root)
        except BurgError as error:  # tried again after the next change of the library
            self.notify(f"library {library.root} can no longer be read: {error}")
            return
        if changed.document == library.document and changed.content == library.content:
            return
        self.notify(library_change_notice(self._history.state, changed))
        self._history.replace_library(changed)
        self._revision += 1
        self._show(replace(self._state, library=changed))

    def _check_scene_file(self) -> None:
        """Adds one notice for each change of the scene's file by another program."""
        path = self._storage.path
        if path is None:
            return
        try:
            found = file_fingerprint(path)
        except InvalidInputError:
            return  # saving reports the error
        if found not in (self._storage.known, self._seen_fingerprint):
            what = "is gone" if found is None else "was changed by another program"
            self.notify(f"{path} {what}; load it, or overwrite it by saving")
        self._seen_fingerprint = found

    def _on_counts(self, job: GraspCountJob, revision: int) -> None:
        """Called in the thread of the worker."""
        with self._exclusive():
            if self._grasp_watch is None or job.cancelled:
                return
            if job.error is not None:
                self.notify(f"grasps cannot be counted: {job.error}")
                self._grasps = ({}, revision)  # counting was cancelled
            elif job.done:
                self._grasps = (job.result, revision)
            elif job.partial is not None:
                self._grasps = ({**self._grasps[0], **job.partial}, self._grasps[1])
            self._publish()

    def _on_settling_change(self, job: BackgroundJob[SettlingProposal]) -> None:
        """Called in the thread of the worker."""
        with self._exclusive():
            if job is not self._settling:
                return
            if job.done:
                self._settling = None
                if job.error is None:
                    self._proposal = job.result
                elif not isinstance(job.error, TaskCancelled):
                    self.notify(f"cannot settle the scene: {job.error}")
            self._publish()

    def _drop_settling(self) -> None:
        job, self._settling = self._settling, None
        self._proposal = None
        if job is not None:
            job.cancel()

    def _add_task_state(self, view: SessionView) -> SessionView:
        if self._grasp_watch is not None:
            scene = scene_of_known_objects(self._history.state, self._storage.place)
            self._grasp_watch.update(scene, self._revision, self._state.selection)
        working = None
        if self._settling is not None:
            share, text = self._settling.progress
            working = f"settling: {text}" if share == 0.0 else f"settling: {share:.0%}, {text}"
        grasps, revision = self._grasps
        return replace(
            view, working=working, proposal=self._proposal, grasps=grasps, grasps_revision=revision
        )
