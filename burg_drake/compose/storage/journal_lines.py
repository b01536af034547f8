"""Steps of a session as lines of JSON, and back.

An instance is written out in the first line that has it, and goes by its number from then on, as a
step leaves nearly all of them alone.
"""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

from burg_drake.compose.document import History, HistoryStep, State
from burg_drake.core.documents import Pose, dump_document, parse_document
from burg_drake.objects.library import ObjectLibrary
from burg_drake.scene.document import Instance, SceneDocument

VERSION = 1


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

    def step(self, step: HistoryStep) -> str:
        """A step that was taken."""
        values: dict[str, Any] = {"step": step.label, "selection": list(step.state.selection)}
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

    def named(self, name: str, reference: str, library: ObjectLibrary) -> str:
        """The scene has another name, and refers to a library by something else."""
        self._head = ""
        return _line({"named": name, "reference": reference, "root": str(library.root)})

    def _document(self, document: SceneDocument) -> dict[str, Any]:
        values: dict[str, Any] = {}
        head = dump_document(replace(document, instances=(), background=()))
        if head != self._head:
            values["head"] = self._head = head
        placed = (*document.instances, *document.background)
        new = [i for i in dict.fromkeys(placed) if i not in self._numbers]
        for instance in new:
            self._numbers[instance] = len(self._numbers)
        if new:
            values["new"] = [_written(instance) for instance in new]
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
        self._instances: list[Instance] = []
        self._head: SceneDocument | None = None

    def take(self, line: str) -> None:
        """Takes the next line.

        Raises:
            ValueError, KeyError, TypeError, IndexError, AttributeError: it is none.
        """
        values = json.loads(line)
        if "journal" in values:
            if values["journal"] != VERSION:
                raise ValueError(f"version {values['journal']!r}")
            self.origin = str(values["origin"])
        elif "step" in values:
            self._step(values)
        elif "at" in values:
            self._require_history().go_to(int(values["at"]))
        elif "saved" in values:
            self.saved = self._document(values) if values["saved"] else None
            self.known = values["known"]
        elif "named" in values:
            library = self._libraries[values["root"]]
            history = self._require_history()
            history.rename(str(values["named"]), str(values["reference"]), library)
            self._head = None
        else:
            raise ValueError("unknown line")

    def _step(self, values: dict[str, Any]) -> None:
        if "library" in values:
            self._library = self._libraries[values["library"]]
        if self._library is None:
            raise ValueError("no library")
        selection = tuple(str(name) for name in values["selection"])
        state = State(self._document(values), self._library, selection)
        step = HistoryStep(str(values["step"]), state)
        if self.history is None:
            self.history = History(state)
        else:
            self.history.add(step)

    def _document(self, values: dict[str, Any]) -> SceneDocument:
        if "head" in values:
            self._head = parse_document(values["head"], SceneDocument, "journal")
        if self._head is None:
            raise ValueError("no head")
        self._instances += [_read(one) for one in values.get("new", ())]
        return replace(
            self._head,
            instances=tuple(self._instances[i] for i in values["instances"]),
            background=tuple(self._instances[i] for i in values.get("background", ())),
        )

    def _require_history(self) -> History:
        if self.history is None:
            raise ValueError("no step")
        return self.history


def library_roots(lines: list[str]) -> list[str]:
    """Folders of the libraries that lines name, in their order; damaged lines are left out."""
    roots: dict[str, None] = {}
    for line in lines:
        try:
            values = json.loads(line)
            if isinstance(values, dict) and isinstance(values.get("library"), str):
                roots[values["library"]] = None
        except ValueError:
            continue
    return list(roots)


def _line(values: dict[str, Any]) -> str:
    return json.dumps(values, separators=(",", ":"), allow_nan=False) + "\n"


def _written(instance: Instance) -> list[Any]:
    X = instance.X_SO
    return [instance.name, instance.object, X.translation, X.rpy_deg, X.quaternion_wxyz]


def _read(values: list[Any]) -> Instance:
    name, object, translation, rpy_deg, quaternion = values
    x, y, z = map(float, translation)
    X_SO = Pose(
        (x, y, z),
        None if rpy_deg is None else _floats(rpy_deg, 3),  # type: ignore[arg-type]
        None if quaternion is None else _floats(quaternion, 4),  # type: ignore[arg-type]
    )
    return Instance(name=str(name), object=str(object), X_SO=X_SO)


def _floats(values: list[Any], count: int) -> tuple[float, ...]:
    if len(values) != count:
        raise ValueError(f"{len(values)} numbers in place of {count}")
    return tuple(map(float, values))
