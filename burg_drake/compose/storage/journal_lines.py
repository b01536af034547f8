"""Steps of a session as lines of JSON, and back.

An instance is written out in the first line that has it, and goes by its number from then on, as a
step leaves nearly all of them alone. Lines say which numbers they give and where among the steps
they are, so that those behind a damaged line can still be read.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

from burg_drake.compose.document import History, HistoryStep, State, name_of
from burg_drake.core import BurgError
from burg_drake.core.documents import Pose, dump_document, parse_document, parse_json
from burg_drake.core.files import Limits
from burg_drake.objects.library import ObjectLibrary
from burg_drake.scene.document import Instance, SceneDocument

VERSION = 1
DAMAGE_ERRORS = (BurgError, ValueError, KeyError, TypeError, AttributeError, OverflowError)
"""Exceptions that a damaged line raises."""
LINE_LIMITS = Limits(size=1 << 26, values=1_000_000, depth=8)
"""Of one line; the deepest one holds a list of instances, each with a list of numbers."""


class JournalWriter:
    """Makes the lines of one journal; the numbers of instances count within it."""

    def __init__(self) -> None:
        self._numbers: dict[Instance, int] = {}
        self._head = ""
        self._library = ""

    def begin(self, origin: str) -> str:
        """The first line.

        Args:
            origin: what the session was opened with, where that was no file of its own.
        """
        return _line({"journal": VERSION, "origin": origin})

    def step(self, step: HistoryStep, position: int) -> str:
        """A step that was taken, and its number in the history."""
        values: dict[str, Any] = {"step": step.label, "at": position}
        values["selection"] = list(step.state.selection)
        library = str(step.state.library.root)
        if library != self._library:
            values["library"] = self._library = library
        return _line(values | self._document(step.state.document))

    def at(self, position: int) -> str:
        """Where among the steps the session is."""
        return _line({"at": position})

    def saved(self, document: SceneDocument | None, known: str | None) -> str:
        """What the scene's file holds.

        Args:
            document: the scene in it; None if there is no file.
            known: its fingerprint.
        """
        values = {} if document is None else self._document(document)
        return _line({"saved": document is not None, "known": known} | values)

    def _document(self, document: SceneDocument) -> dict[str, Any]:
        values: dict[str, Any] = {}
        head = dump_document(replace(document, instances=(), background=()))
        if head != self._head:
            values["head"] = self._head = head
        placed = (*document.instances, *document.background)
        new = [i for i in dict.fromkeys(placed) if i not in self._numbers]
        if new:
            values["from"] = len(self._numbers)
            values["new"] = [_written(instance) for instance in new]
        for instance in new:
            self._numbers[instance] = len(self._numbers)
        values["instances"] = [self._numbers[i] for i in document.instances]
        if document.background:
            values["background"] = [self._numbers[i] for i in document.background]
        return values


class JournalReader:
    """Takes the lines of one journal, in their order.

    Attributes:
        origin: what the session was opened with, where that was no file of its own.
        history: of the session, as soon as there is one.
        saved: what the scene's file holds; None if there is none.
        known: fingerprint of that file.
    """

    def __init__(self, libraries: dict[str, ObjectLibrary]) -> None:
        """Args:
        libraries: by their folders.
        """
        self.origin = ""
        self.history: History | None = None
        self.saved: SceneDocument | None = None
        self.known: str | None = None
        self._libraries = libraries
        self._library: ObjectLibrary | None = None
        self._instances: dict[int, Instance] = {}
        self._next: int | None = 0
        self._positions: list[int] = []
        self._head: SceneDocument | None = None
        self._damaged = False
        self._whole_line = True

    def take(self, line: str) -> bool:
        """Takes what can be read of the next line.

        An instance that cannot be read is left out, of this line and of later ones.

        Returns:
            Whether that is all of the line.
        """
        self._whole_line = True
        try:
            self._take(parse_json(line, "journal", LINE_LIMITS))
        except DAMAGE_ERRORS:
            self._whole_line = False
            self._next = None  # the number of instances in the line is unknown
        self._damaged |= not self._whole_line
        return self._whole_line

    def _take(self, values: dict[str, Any]) -> None:
        if "journal" in values:
            if values["journal"] != VERSION:
                raise ValueError(f"version {values['journal']!r}")
            self.origin = _text(values["origin"])
        elif "step" in values:
            self._step(values)
        elif "at" in values:
            self._go_to(_whole(values["at"]))
        elif "saved" in values:
            saved = self._document(values) if values["saved"] else None
            known = values["known"]
            if not isinstance(known, str | None):
                raise TypeError("known")
            self.saved, self.known = saved, known
        else:
            raise ValueError("unknown line")

    def _step(self, values: dict[str, Any]) -> None:
        library = self._libraries[values["library"]] if "library" in values else self._library
        if library is None:
            raise ValueError("no library")
        state = State(self._document(values), library)
        label, there = _text(values["step"]), state.instances
        state = state.select(name for name in values["selection"] if name in there)
        last = self._positions[self.history.position] if self.history else -1
        position = _whole(values.get("at", last + 1))
        self._library = library
        if self.history is None:
            self.history = History(state)
            self._positions = [position]
            return
        if position <= self._positions[0]:
            raise ValueError(f"step {position} of a history that begins later")
        self._go_to(position - 1)
        self.history.add(HistoryStep(label, state))
        self._positions[self.history.position :] = [position]

    def _go_to(self, position: int) -> None:
        """Goes to a step by its number; to the one before it that was read if it was not."""
        if self.history is None or position < self._positions[0]:
            raise ValueError(f"no step {position}")
        self.history.go_to(sum(known <= position for known in self._positions) - 1)

    def _document(self, values: dict[str, Any]) -> SceneDocument:
        head = self._head
        if "head" in values:
            head = parse_document(values["head"], SceneDocument, "journal")
        if head is None:
            raise ValueError("no head")
        new, written = {}, values.get("new", [])
        if written:
            first = values.get("from", self._next)
            new = self._read_instances(written, _whole(first))
        instances = self._instances | new
        document = replace(
            head,
            instances=self._known(values["instances"], instances),
            background=self._known(values.get("background", []), instances),
        )
        placed = (*document.instances, *document.background)
        if len({name_of(instance) for instance in placed}) < len(placed):
            raise ValueError("a name appears twice")
        self._head, self._instances = head, instances
        if written and self._next is not None:
            self._next += len(written)
        return document

    def _read_instances(self, written: list[Any], first: int) -> dict[int, Instance]:
        """Instances by their numbers."""
        found = {}
        for number, values in enumerate(written, first):
            try:
                found[number] = _read(values)
            except DAMAGE_ERRORS:
                self._whole_line = False
        return found

    def _known(self, numbers: list[Any], instances: dict[int, Instance]) -> tuple[Instance, ...]:
        """The instances of these numbers, without those that could not be read."""
        missing = [number for number in map(_whole, numbers) if number not in instances]
        if missing and self._whole_line and not self._damaged:
            raise KeyError(missing[0])
        return tuple(instances[number] for number in numbers if number in instances)


def library_roots(lines: list[str]) -> list[str]:
    """Folders of the libraries that lines name, in their order; damaged lines are left out."""
    roots: dict[str, None] = {}
    for line in lines:
        if '"library"' not in line:
            continue
        try:
            values = parse_json(line, "journal", LINE_LIMITS)
        except BurgError:
            continue
        if isinstance(values, dict) and isinstance(values.get("library"), str):
            roots[values["library"]] = None
    return list(roots)


def _line(values: dict[str, Any]) -> str:
    return json.dumps(values, separators=(",", ":"), allow_nan=False) + "\n"


def _written(instance: Instance) -> list[Any]:
    X = instance.X_SO
    return [instance.name, instance.object, X.translation, X.rpy_deg, X.quaternion_wxyz]


def _read(values: list[Any]) -> Instance:
    name, object, translation, rpy_deg, quaternion = values
    X_SO = Pose(
        _floats(translation, 3),  # type: ignore[arg-type]
        None if rpy_deg is None else _floats(rpy_deg, 3),  # type: ignore[arg-type]
        None if quaternion is None else _floats(quaternion, 4),  # type: ignore[arg-type]
    )
    return Instance(name=str(name), object=str(object), X_SO=X_SO)


def _floats(values: list[Any], count: int) -> tuple[float, ...]:
    numbers = tuple(map(float, values))
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise ValueError(f"{values!r} in place of {count} numbers")
    return numbers


def _text(value: Any) -> str:
    value.encode()  # a half of a surrogate pair could not be shown
    return str(value)


def _whole(value: Any) -> int:
    if not isinstance(value, int) or isinstance(value, bool):
        raise TypeError(f"{value!r} in place of a whole number")
    return value
