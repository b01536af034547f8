"""Finds scene and station of a trial that a row tells of, wherever the row is now."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from burg_drake.core.errors import BurgError, InvalidInputError
from burg_drake.evaluation.origin import Origin
from burg_drake.evaluation.run_document import HASH_DIGITS
from burg_drake.evaluation.run_store import RUN_FILE, load_run
from burg_drake.scene.scene import Scene, load_scene
from burg_drake.station.station import Station, load_station

Document = TypeVar("Document", Scene, Station)
Place = tuple[str, Callable[[], Document]]


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
    origin: Origin,
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
    scenes: list[Place[Scene]]
    stations: list[Place[Station]]
    scenes = [(text := scene or origin.scene, lambda: load_scene(text))]
    stations = [(word := station or origin.station, lambda: load_station(word))]
    if origin.run and (folder / RUN_FILE).exists():
        run = load_run(folder)
        if run.document.hash == origin.run:
            scenes[:0] = [] if scene else [("the run's copy", run.scene)]
            stations[:0] = [] if station else [("the run's copy", run.station)]
    search = _Search(origin, where, force)
    first, note = search.find("scene", origin.scene_content, scenes)
    second, other = search.find("station", origin.station_content, stations)
    return Inputs(first, second, tuple(text for text in (note, other) if text))


@dataclass(frozen=True)
class _Search:
    origin: Origin
    where: str
    force: bool

    def find(
        self, kind: str, content: str, places: Sequence[Place[Document]]
    ) -> tuple[Document, str]:
        """The first document that fits, and a note if it is taken though it does not fit."""
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
        go_on = f", or --force to replay on {other.path}" if other is not None else ""
        raise InvalidInputError(
            f"{self.where} needs the {kind} with content {content} ({meant}), but {found}; give"
            f" --{kind} FILE ({copy}){go_on}"
        )
