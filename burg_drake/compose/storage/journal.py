"""The journal beside a scene: each step is on the disk before the next one, so that a session that
is killed can go on where it was, its history included."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from burg_drake.compose.document import History
from burg_drake.compose.storage.journal_lines import JournalReader, JournalWriter, library_roots
from burg_drake.core import BurgError, InvalidInputError
from burg_drake.core.files import atomic_write, read_bytes
from burg_drake.objects.library import ObjectLibrary, load_library
from burg_drake.scene.document import SceneDocument

MAX_JOURNAL_SIZE = 1 << 30
"""Bytes of a journal; a step takes some hundred."""


class LibraryMissing(InvalidInputError):
    """A journal needs a library that is not where it was."""


@dataclass(frozen=True)
class Recovered:
    """What a journal holds.

    Attributes:
        history: of the session.
        saved: what the scene's file held; None if there was none.
        known: fingerprint of that file.
        origin: what the session was opened with, where that was no file of its own.
        damage: what of the journal could not be read; empty if all of it was.
    """

    history: History | None = None
    saved: SceneDocument | None = None
    known: str | None = None
    origin: str = ""
    damage: str = ""


def journal_path(scene: Path) -> Path:
    """The journal beside a scene's file."""
    return scene.with_name(f".{scene.name}.journal")


class SessionJournal:
    """Writes steps as they are taken.

    A journal is begun with the first step. If it cannot be written, all of it is tried again with
    the next one.

    Attributes:
        path: of the file.
        origin: what the session was opened with, where that was no file of its own.
        problem: why the last steps are not on the disk; None if they are.
    """

    def __init__(self, path: Path, origin: str = "") -> None:
        self.path = path
        self.origin = origin
        self.problem: str | None = None
        self._writer: JournalWriter | None = None

    def step(self, history: History, saved: SceneDocument | None, known: str | None) -> None:
        """The history has one more step, and is there; the rest is as in `JournalWriter.saved`."""
        position = history.position
        self._record(lambda w: w.step(history.steps[position], position), history, saved, known)

    def at(self, history: History, saved: SceneDocument | None, known: str | None) -> None:
        """The history is at another step."""
        self._record(lambda w: w.at(history.position), history, saved, known)

    def rewrite(self, history: History, saved: SceneDocument | None, known: str | None) -> None:
        """Writes all of it anew."""
        writer = JournalWriter()
        lines = [writer.begin(self.origin)]
        lines += [writer.step(step, position) for position, step in enumerate(history.steps)]
        lines += [writer.at(history.position), writer.saved(saved, known)]
        try:
            atomic_write(self.path, "".join(lines))
        except InvalidInputError as error:
            self._writer, self.problem = None, str(error)
        else:
            self._writer, self.problem = writer, None

    def remove(self) -> None:
        """Takes it off the disk: all that it has is in the scene's file, or is not wanted."""
        self._writer = None
        with contextlib.suppress(OSError):
            self.path.unlink(missing_ok=True)

    def _record(
        self,
        line: Callable[[JournalWriter], str],
        history: History,
        saved: SceneDocument | None,
        known: str | None,
    ) -> None:
        if self._writer is None:
            self.rewrite(history, saved, known)
            return
        try:
            _append(self.path, line(self._writer).encode())
        except OSError as error:
            self._writer = None
            self.problem = f"cannot write {self.path}: {error.strerror or error}"


def recover(path: Path) -> Recovered | None:
    """Reads a journal that a session left.

    A last line that was not written to its end is left out. Of a journal that is damaged, all that
    can be read is recovered; see `set_aside`.

    Returns:
        What it holds; None if there is none.

    Raises:
        LibraryMissing: the library of its last steps is not there.
    """
    if not path.exists():
        return None
    try:
        text = read_bytes(path, MAX_JOURNAL_SIZE).decode("utf-8", errors="replace")
    except InvalidInputError as error:
        return Recovered(damage=str(error))
    whole, _, _ = text.rpartition("\n")
    lines = whole.split("\n") if whole else []
    try:
        reader = JournalReader(_libraries(lines))
    except BurgError as error:
        raise LibraryMissing(
            f"{error}; the last session of this scene used it, and its steps are in {path}:"
            " restore the library, or delete that file"
        ) from error
    damaged = [number for number, line in enumerate(lines, 1) if not reader.take(line)]
    return Recovered(
        reader.history, reader.saved, reader.known, reader.origin, _damage(damaged, len(lines))
    )


def set_aside(path: Path) -> Path:
    """Renames a damaged journal, so that no other one takes its place.

    Returns:
        Where it is; `path` itself where nothing can be renamed, and so nothing be written.
    """
    number = 1
    while (aside := path.with_name(f"{path.name}.damaged_{number}")).exists():
        number += 1
    try:
        os.replace(path, aside)
    except OSError:
        return path
    return aside


def _damage(damaged: list[int], count: int) -> str:
    if not count:
        return "it has no complete line"
    if not damaged:
        return ""
    lines = f"line {damaged[0]}"
    if len(damaged) > 1:
        lines = f"lines {', '.join(map(str, damaged[:-1]))} and {damaged[-1]}"
    if len(damaged) > 5:
        lines = f"{len(damaged)} lines, the first of them {damaged[0]},"
    return f"{lines} of {count} cannot be read"


def _libraries(lines: list[str]) -> dict[str, ObjectLibrary]:
    """Libraries by their folders; the one that came next stands for one that is gone.

    Raises:
        BurgError: the last one cannot be loaded.
    """
    found: dict[str, ObjectLibrary] = {}
    later: ObjectLibrary | None = None
    for root in reversed(library_roots(lines)):
        try:
            later = load_library(root)
        except BurgError:
            if later is None:
                raise
        found[root] = later
    return found


def _append(path: Path, line: bytes) -> None:
    """Appends a line, or nothing."""
    with path.open("r+b") as stream:
        end = stream.seek(0, os.SEEK_END)
        try:
            stream.write(line)
            stream.flush()
            os.fsync(stream.fileno())
        except OSError:
            with contextlib.suppress(OSError):
                os.truncate(path, end)
            raise
