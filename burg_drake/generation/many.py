"""Samples many scenes in worker processes, into a folder that goes on where it was left."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from burg_drake.core import InvalidInputError, SimulationError, one_line
from burg_drake.core.workers import map_unordered
from burg_drake.generation.folder import SceneFolder, SceneRow
from burg_drake.generation.sample import (
    SampledScene,
    SceneSampler,
    provenance_of,
    require_possible,
)
from burg_drake.objects.library import ObjectLibrary, load_library
from burg_drake.scene.document import SamplingProvenance, SceneRecipe
from burg_drake.station.document import Station, StationLike, as_station, load_station


@dataclass(frozen=True)
class SamplingInputs:
    """Where a recipe's scenes are made: all that a worker needs to know.

    Attributes:
        recipe: the recipe.
        library, station: where they are.
        contents: hashes of the two, so that nobody goes on with what has changed.
        folder: that scenes are written to.
    """

    recipe: SceneRecipe
    library: Path
    station: Path
    contents: tuple[str, str]
    folder: Path


@dataclass(frozen=True)
class SceneTask:
    """A scene to sample: where, and its number."""

    inputs: SamplingInputs
    number: int


@dataclass(frozen=True)
class SampledFolder:
    """What is in a folder after sampling.

    Attributes:
        rows: of all scenes that were asked for and came to an end, by number.
        new: numbers of those that were sampled now.
        failed: one line for each scene that could not be sampled, by number: they are tried again
            the next time.
    """

    rows: dict[int, SceneRow]
    new: tuple[int, ...]
    failed: dict[int, str]


def sample_scenes(
    recipe: SceneRecipe,
    library: ObjectLibrary,
    station: StationLike,
    folder: str | Path,
    count: int,
    *,
    workers: int = 1,
    progress: Callable[[SampledScene], None] | None = None,
    known: Callable[[int], None] | None = None,
) -> SampledFolder:
    """Samples scenes 0 to `count` - 1 of a recipe, but for those that the folder has.

    Example::

        library, station = burg.load_library("household"), burg.load_station("panda_tabletop")
        recipe = burg.SceneRecipe(library="household", count=5, layout="packed")
        burg.sample_scenes(recipe, library, station, "scenes", 100, workers=4)

    Args:
        recipe: how scenes are drawn; what it refers to is relative to the folder.
        library, station: those of the recipe.
        folder: where to write.
        count: number of scenes.
        workers: number of processes; with one this process does it.
        progress: called after each scene.
        known: called at the beginning with the number of scenes that the folder has.

    Raises:
        InvalidInputError, UnknownNameError: see `SceneFolder` and `require_possible`.
    """
    station = as_station(station)
    require_possible(recipe, library, station)
    provenance = provenance_of(recipe, library, station)
    with SceneFolder(folder, provenance) as opened:
        inputs = _sampling_inputs(provenance, library, station, opened.path)
        todo = [SceneTask(inputs, number) for number in range(count) if number not in opened.rows]
        if known is not None:
            known(count - len(todo))
        new: list[int] = []
        failed: dict[int, str] = {}
        try:
            for work, outcome in map_unordered(sample_scene, todo, workers):
                if isinstance(outcome, BaseException):
                    failed[work.number] = one_line(outcome)
                    continue
                opened.add(outcome)
                new.append(work.number)
                if progress is not None:
                    progress(outcome)
        finally:
            opened.sort()
        rows = {number: row for number, row in sorted(opened.rows.items()) if number < count}
    return SampledFolder(rows, tuple(sorted(new)), failed)


def sample_scene(work: SceneTask) -> SampledScene:
    """Samples one scene.

    Raises:
        SimulationError: Drake ended by a failed condition.
        Exception: what cannot be simulated is one failure.
    """
    try:
        return _sampler(work.inputs).sample(work.number, work.inputs.folder)
    except SystemExit as error:  # DRAKE_DEMAND ends this way
        raise SimulationError(f"Drake failed: {error}") from error


def _sampling_inputs(
    provenance: SamplingProvenance, library: ObjectLibrary, station: Station, folder: Path
) -> SamplingInputs:
    contents = (provenance.library_content, provenance.station_content)
    return SamplingInputs(provenance.recipe, library.root, station.path, contents, folder)


@lru_cache(maxsize=1)
def _sampler(inputs: SamplingInputs) -> SceneSampler:
    """The sampler that a process keeps from scene to scene.

    Raises:
        InvalidInputError: library or station are not any more what they were.
    """
    library, station = load_library(inputs.library), load_station(inputs.station)
    sampler = SceneSampler(inputs.recipe, library, station)
    there = sampler.provenance
    for what, found, path, content in (
        ("library", there.library_content, library.root, inputs.contents[0]),
        ("station", there.station_content, station.path, inputs.contents[1]),
    ):
        if found != content:
            raise InvalidInputError(
                f"the {what} {path} was changed while scenes were sampled; run the command again"
            )
    return sampler
