"""Finds scene and station of a trial that a row tells of, wherever the row is now."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from burg_drake.core import BurgError, InvalidInputError, UnknownNameError
from burg_drake.core.paths import resolve
from burg_drake.evaluation.records import HASH_DIGITS, TrialOrigin
from burg_drake.evaluation.store.run_folder import RUN_FILE, load_run
from burg_drake.scene.document import Scene, load_scene
from burg_drake.station.document import Station, load_station

Document = TypeVar("Document", Scene, Station)
FilePlace = tuple[str, Callable[[], Document]]


@dataclass(frozen=True)
class Inputs:
    """What a trial was executed on.

    Attributes:
        scene, station: as found.
        notes: how they differ from what was asked for, for people; empty if they do not.
    """

    scene: Scene
    station: Station
    notes: tuple[str, ...] = ()


def find_inputs(
    origin: TrialOrigin,
    where: str,
    folder: Path,
    *,
    scene: str | None = None,
    station: str | None = None,
    force: bool = False,
) -> Inputs:
    """Loads the documents with the contents that the row asks for.

    Args:
        origin: what the row tells.
        where: names the row in messages.
        folder: of the table; if it is the folder of the row's run, its copies come first.
        scene, station: where to look instead.
        force: takes documents of another content, too.

    Raises:
        InvalidInputError: a document is not where it was, or has another content; the message
            says which one is needed.
    """
    scenes: list[FilePlace[Scene]]
    stations: list[FilePlace[Station]]
    text, word = scene or origin.scene, station or origin.station
    scenes = [(text, lambda: load_scene(_existing(text, "scenes")))]
    stations = [(word, lambda: load_station(_existing(word, "stations")))]
    if origin.run and (folder / RUN_FILE).exists():
        run = load_run(folder)
        if run.document.hash == origin.run:
            scenes[:0] = [] if scene else [("the run's copy", run.scene)]
            stations[:0] = [] if station else [("the run's copy", run.station)]
    search = _InputSearch(origin, force)
    first = search.find("scene", origin.scene_content, scenes)
    second = search.find("station", origin.station_content, stations)
    missing = [found for found in (first, second) if isinstance(found, str)]
    if isinstance(first, str) or isinstance(second, str):
        found = {"scene": first, "station": second}
        kinds = [kind for kind, missed in found.items() if isinstance(missed, str)]
        raise InvalidInputError(f"{where} needs {'; and '.join(missing)}").about(
            *kinds, *(["force"] if any("by force" in text for text in missing) else [])
        )
    return Inputs(first[0], second[0], tuple(note for _, note in (first, second) if note))


def _existing(reference: str, kind: str) -> Path:
    """The file of a document; what else there is would not help here."""
    try:
        return resolve(reference, kind)
    except UnknownNameError as error:
        raise UnknownNameError(f"{reference} does not exist") from error


@dataclass(frozen=True)
class _InputSearch:
    origin: TrialOrigin
    force: bool

    def find(
        self, kind: str, content: str, places: Sequence[FilePlace[Document]]
    ) -> tuple[Document, str] | str:
        """The first document that fits, and a note if it is taken though it does not fit; what is
        needed if there is none."""
        problems: list[str] = []
        other: Document | None = None
        for place, load in places:
            try:
                document = load()
            except BurgError as error:
                problems.append(str(error))
                continue
            if document.content.startswith(content):
                return document, ""
            problems.append(f"{place} has content {document.content[:HASH_DIGITS]}")
            other = other or document
        found = "; ".join(problems)
        if other is not None and self.force:
            return other, f"the {kind} is not the one of the trial (content {content}): {found}"
        meant = "objects and their library count" if kind == "scene" else "robot models count"
        copy = f"a copy is {kind}.yaml in the folder of run {self.origin.run}"
        go_on = f", or replay on {other.path} by force" if other is not None else ""
        return (
            f"the {kind} with content {content} ({meant}), but {found}; give its file ("
            f"{copy}){go_on}"
        )
