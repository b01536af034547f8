"""The journal of a session: every step is on disk, so that a killed session can be recovered."""

from __future__ import annotations

import contextlib
import json
import math
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from burg_drake.compose.state import History, HistoryStep, State, instance_name
from burg_drake.core import (
    BurgError,
    InvalidInputError,
    Limits,
    Pose,
    dump_document,
    parse_document,
    parse_json,
    read_bytes,
)
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.scene import Instance, SceneDocument

JOURNAL_VERSION = 1  # Version of the journal's format.
DAMAGE_ERRORS = (BurgError, ValueError, KeyError, TypeError, AttributeError, OverflowError)
"""Exceptions that a damaged line raises."""
JOURNAL_LINE_LIMITS = Limits(size=1 << 26, values=1_000_000, depth=8)
"""Limits of one line; the deepest nesting is a list of instances with lists of numbers."""


class JournalWriter:
    """Makes the lines of one journal; numbers the instances in the order of writing."""

    def __init__(self) -> None:
        self._numbers: dict[Instance, int] = {}
        self._head = ""
        self._library = ""

    def first_line(self, origin: str) -> str:
        """The first line.

        Args:
            origin: reference that the session was opened with; empty for a scene file.
        """
        return _json_line({"journal": JOURNAL_VERSION, "origin": origin})

    def step_line(self, step: HistoryStep, position: int) -> str:
        """The line for a new step, with its number in the history."""
        values: dict[str, Any] = {"step": step.label, "at": position}
        values["selection"] = list(step.state.selection)
        library = str(step.state.library.root)
        if library != self._library:
            values["library"] = self._library = library
        return _json_line(values | self._document_values(step.state.document))

    def position_line(self, position: int) -> str:
        """The line for the session's position in the history."""
        return _json_line({"at": position})

    def saved_line(self, document: SceneDocument | None, known: str | None) -> str:
        """The line for the content of the scene's file.

        Args:
            document: the scene in the file; None if there is no file.
            known: fingerprint of the file.
        """
        values = {} if document is None else self._document_values(document)
        return _json_line({"saved": document is not None, "known": known} | values)

    def _document_values(self, document: SceneDocument) -> dict[str, Any]:
        values: dict[str, Any] = {}
        head = dump_document(replace(document, instances=(), background=()))
        if head != self._head:
            values["head"] = self._head = head
        placed = (*document.instances, *document.background)
        new = [i for i in dict.fromkeys(placed) if i not in self._numbers]
        if new:
            values["from"] = len(self._numbers)
            values["new"] = [_write_instance(instance) for instance in new]
        for instance in new:
            self._numbers[instance] = len(self._numbers)
        values["instances"] = [self._numbers[i] for i in document.instances]
        if document.background:
            values["background"] = [self._numbers[i] for i in document.background]
        return values


@dataclass
class RecoveredSession:
    """The content of a journal.

    Attributes:
        history: history of the session.
        saved: scene in the scene's file; None if there was no file.
        known: fingerprint of that file.
        origin: reference that the session was opened with; empty for a scene file.
        damage: lines of the journal that cannot be read, as text; empty if there are none.
    """

    history: History | None = None
    saved: SceneDocument | None = None
    known: str | None = None
    origin: str = ""
    damage: str = ""


class JournalReader:
    """Reads the lines of one journal, in their order.

    Args:
        libraries: libraries by folder.

    Attributes:
        session: the content read so far.
    """

    def __init__(self, libraries: dict[str, ObjectLibrary]) -> None:
        self.session = RecoveredSession()
        self._libraries = libraries
        self._library: ObjectLibrary | None = None
        self._instances: dict[int, Instance] = {}
        self._next_number: int | None = 0
        self._positions: list[int] = []
        self._head: SceneDocument | None = None
        self._damaged = False
        self._whole_line = True

    def read(self, line: str) -> bool:
        """Reads the next line as far as possible.

        An unreadable instance is left out, in this line and in later ones.

        Returns:
            Whether the whole line was read.
        """
        self._whole_line = True
        try:
            self._read_line(parse_json(line, "journal", JOURNAL_LINE_LIMITS))
        except DAMAGE_ERRORS:
            self._whole_line = False
            self._next_number = None  # the number of instances in the line is unknown
        self._damaged |= not self._whole_line
        return self._whole_line

    def _read_line(self, values: dict[str, Any]) -> None:
        if "journal" in values:
            if values["journal"] != JOURNAL_VERSION:
                raise ValueError(f"version {values['journal']!r}")
            self.session.origin = _read_text(values["origin"])
        elif "step" in values:
            self._read_step(values)
        elif "at" in values:
            self._go_to(_read_integer(values["at"]))
        elif "saved" in values:
            saved = self._read_document(values) if values["saved"] else None
            known = values["known"]
            if not isinstance(known, str | None):
                raise TypeError("known")
            self.session.saved, self.session.known = saved, known
        else:
            raise ValueError("unknown line")

    def _read_step(self, values: dict[str, Any]) -> None:
        library = self._libraries[values["library"]] if "library" in values else self._library
        if library is None:
            raise ValueError("no library")
        state = State(self._read_document(values), library)
        label, placed = _read_text(values["step"]), state.instances
        state = state.select(name for name in values["selection"] if name in placed)
        history = self.session.history
        last = self._positions[history.position] if history else -1
        position = _read_integer(values.get("at", last + 1))
        self._library = library
        if history is None:
            self.session.history = History(state)
            self._positions = [position]
            return
        if position <= self._positions[0]:
            raise ValueError(f"step {position} of a history that begins later")
        self._go_to(position - 1)
        history.add(HistoryStep(label, state))
        self._positions[history.position :] = [position]

    def _go_to(self, position: int) -> None:
        """Goes to the step of this number, or to the last readable one before it."""
        history = self.session.history
        if history is None or position < self._positions[0]:
            raise ValueError(f"no step {position}")
        history.position = sum(known <= position for known in self._positions) - 1

    def _read_document(self, values: dict[str, Any]) -> SceneDocument:
        head = self._head
        if "head" in values:
            head = parse_document(values["head"], SceneDocument, "journal")
        if head is None:
            raise ValueError("no head")
        new, written = {}, values.get("new", [])
        if written:
            first = values.get("from", self._next_number)
            new = self._read_instances(written, _read_integer(first))
        instances = self._instances | new
        document = replace(
            head,
            instances=self._select_instances(values["instances"], instances),
            background=self._select_instances(values.get("background", []), instances),
        )
        placed = (*document.instances, *document.background)
        if len({instance_name(instance) for instance in placed}) < len(placed):
            raise ValueError("a name appears twice")
        self._head, self._instances = head, instances
        if written and self._next_number is not None:
            self._next_number += len(written)
        return document

    def _read_instances(self, written: list[Any], first: int) -> dict[int, Instance]:
        """Instances by their numbers."""
        found = {}
        for number, values in enumerate(written, first):
            try:
                found[number] = _read_instance(values)
            except DAMAGE_ERRORS:
                self._whole_line = False
        return found

    def _select_instances(
        self, numbers: list[Any], instances: dict[int, Instance]
    ) -> tuple[Instance, ...]:
        """The instances of these numbers; unreadable ones are left out."""
        missing = [number for number in map(_read_integer, numbers) if number not in instances]
        if missing and self._whole_line and not self._damaged:
            raise KeyError(missing[0])
        return tuple(instances[number] for number in numbers if number in instances)


def library_roots(lines: list[str]) -> list[str]:
    """Folders of the libraries named in the lines, in order; skips damaged lines."""
    roots: dict[str, None] = {}
    for line in lines:
        if '"library"' not in line:
            continue
        try:
            values = parse_json(line, "journal", JOURNAL_LINE_LIMITS)
        except BurgError:
            continue
        if isinstance(values, dict) and isinstance(values.get("library"), str):
            roots[values["library"]] = None
    return list(roots)


def _json_line(values: dict[str, Any]) -> str:
    return json.dumps(values, separators=(",", ":"), allow_nan=False) + "\n"


def _write_instance(instance: Instance) -> list[Any]:
    X = instance.X_SO
    return [instance.name, instance.object, X.translation, X.rpy_deg, X.quaternion_wxyz]


def _read_instance(values: list[Any]) -> Instance:
    name, object, translation, rpy_deg, quaternion = values
    X_SO = Pose(
        _read_floats(translation, 3),  # type: ignore[arg-type]
        None if rpy_deg is None else _read_floats(rpy_deg, 3),  # type: ignore[arg-type]
        None if quaternion is None else _read_floats(quaternion, 4),  # type: ignore[arg-type]
    )
    return Instance(name=str(name), object=str(object), X_SO=X_SO)


def _read_floats(values: list[Any], count: int) -> tuple[float, ...]:
    numbers = tuple(map(float, values))
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise ValueError(f"{values!r} in place of {count} numbers")
    return numbers


def _read_text(value: Any) -> str:
    value.encode()  # a lone surrogate could not be shown
    return str(value)


def _read_integer(value: Any) -> int:
    if not isinstance(value, int) or isinstance(value, bool):
        raise TypeError(f"{value!r} in place of a whole number")
    return value


class LibraryMissing(InvalidInputError):
    """A journal refers to a library that is no longer in its folder."""


def journal_path(scene: Path) -> Path:
    """The journal beside a scene's file."""
    return scene.with_name(f".{scene.name}.journal")


def recover_journal(path: Path) -> RecoveredSession | None:
    """Reads the journal that an earlier session left.

    An incomplete last line is left out. The readable part of a damaged journal is recovered; see
    `set_journal_aside`.

    Returns:
        The content; None if there is no journal.

    Raises:
        LibraryMissing: the library of its last steps is missing.
    """
    max_size = 1 << 30  # Bytes; a step takes some hundred bytes.
    if not path.exists():
        return None
    try:
        text = read_bytes(path, max_size).decode("utf-8", errors="replace")
    except InvalidInputError as error:
        return RecoveredSession(damage=str(error))
    whole, _, _ = text.rpartition("\n")
    lines = whole.split("\n") if whole else []
    try:
        reader = JournalReader(_load_libraries(lines))
    except BurgError as error:
        raise LibraryMissing(
            f"{error}; the last session of this scene used it, and its steps are in {path}:"
            " restore the library, or delete that file"
        ) from error
    damaged = [number for number, line in enumerate(lines, 1) if not reader.read(line)]
    reader.session.damage = _describe_damage(damaged, len(lines))
    return reader.session


def set_journal_aside(path: Path) -> Path:
    """Renames a damaged journal, so that a new one does not overwrite it.

    Returns:
        The new path; `path` itself if the folder is read-only, so that nothing overwrites it.
    """
    number = 1
    while (aside := path.with_name(f"{path.name}.damaged_{number}")).exists():
        number += 1
    try:
        os.replace(path, aside)
    except OSError:
        return path
    return aside


def _describe_damage(damaged: list[int], count: int) -> str:
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


def _load_libraries(lines: list[str]) -> dict[str, ObjectLibrary]:
    """Libraries by folder; a missing library is replaced by the next one in the journal.

    Raises:
        BurgError: the last library cannot be loaded.
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


def append_line(path: Path, line: bytes) -> None:
    """Appends a line; on an error the file keeps its old content."""
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
