"""Where a session's scene is on the disk: its file, the lock on it, and the journal beside it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from burg_drake.compose.document import History
from burg_drake.compose.storage.journal import SessionJournal, journal_path
from burg_drake.compose.storage.scene_file import scene_path, write_scene
from burg_drake.compose.storage.scene_lock import SceneLock
from burg_drake.scene.document import SceneDocument


class Storage:
    """The files of one scene.

    Attributes:
        place: where the scene's file is, or would be if it had one.
        path: the scene's file; None if it has none.
        known: `scene_file.fingerprint` that the file should have.
        saved: what it holds.
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
        self._lock = lock
        self._journal = SessionJournal(journal_path(place), origin)

    @property
    def problem(self) -> str | None:
        """Why steps are not in the journal; None if they are."""
        return self._journal.problem

    def announce(self, address: str) -> None:
        """Says where the session's page is, for those who find the scene in use."""
        self._lock.announce(address)

    def record_step(self, history: History) -> None:
        """The history has one more step, and is there."""
        self._journal.step(history, self.saved, self.known)

    def record_position(self, history: History) -> None:
        """The history is at another step."""
        self._journal.at(history, self.saved, self.known)

    def record_all(self, history: History) -> None:
        """The history is another one."""
        self._journal.rewrite(history, self.saved, self.known)

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
            self._journal.remove()
            self._lock.release()
            self._lock, self.place = lock, place
            self._journal = SessionJournal(journal_path(place))
        history.rename(written.name, written.library, state.library)
        self.path, self.known, self.saved = place, fingerprint, written
        self._journal.origin = ""
        self.record_all(history)

    def close(self, *, keep: bool) -> None:
        """Lets others open the scene.

        Args:
            keep: the journal, as there is something in it that is in no file.
        """
        if not keep:
            self._journal.remove()
        self._lock.release()
