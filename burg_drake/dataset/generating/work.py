"""A scene and its samples, made and written by one process; what `generate` hands out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from burg_drake.core import InvalidInputError, SimulationError
from burg_drake.dataset.generating.recipe import DatasetRecipe
from burg_drake.dataset.generating.scene_samples import SceneSamples
from burg_drake.dataset.samples import ShardEntry, write_scene
from burg_drake.generation import SceneSampler
from burg_drake.objects.library import ObjectLibrary, load_library
from burg_drake.scene.document import Scene, load_scene
from burg_drake.station.document import Station, load_station


@dataclass(frozen=True)
class DatasetInputs:
    """What all scenes of a data set are made with.

    Attributes:
        recipe: of the data set.
        folder: of the data set.
        station: its file.
        library: folder of the objects of sampled scenes; None for given ones.
    """

    recipe: DatasetRecipe
    folder: Path
    station: Path
    library: Path | None


@dataclass(frozen=True)
class SceneWork:
    """A scene to make samples of.

    Attributes:
        inputs: of the data set.
        number: of the scene.
        path: of its document; None if it is sampled.
    """

    inputs: DatasetInputs
    number: int
    path: Path | None


def make_scene(work: SceneWork) -> ShardEntry:
    """Writes a scene and its samples.

    Raises:
        SimulationError: no scene was accepted, or Drake ended by a failed condition.
        Exception: what cannot be rendered is one failure.
    """
    inputs = work.inputs
    with drake_errors():
        station = _station(inputs.station)
        if work.path is not None:
            scene = given_scene(work)
        else:
            scene = accepted_scene(_sampler(inputs), work.number, inputs.folder)
        samples = SceneSamples(scene, work.number, station, inputs.recipe, inputs.folder)
        return write_scene(inputs.folder, work.number, scene, samples)


def given_scene(
    work: SceneWork, library: Callable[[str, Path | None], ObjectLibrary] = load_library
) -> Scene:
    """The scene of a document, as it was when the data set was begun.

    Args:
        work: with a path.
        library: as in `load_scene`.

    Raises:
        InvalidInputError: it is another one by now.
        UnknownNameError, DocumentError: as `load_scene`.
    """
    assert work.path is not None
    scene = load_scene(work.path, library=library)
    if scene.content != work.inputs.recipe.given[work.number]:
        raise InvalidInputError(
            f"{work.path} was changed while the data set was made; run the command again"
        )
    return scene


def accepted_scene(sampler: SceneSampler, number: int, folder: Path) -> Scene:
    """The sampled scene of a number.

    Args:
        sampler: of the recipe.
        number: of the scene.
        folder: of the data set.

    Raises:
        SimulationError: none was accepted.
    """
    sampled = sampler.sample(number, folder / "scenes")
    if not sampled.accepted:
        reasons = ", ".join(f"{count} x {reason}" for reason, count in sampled.refused.items())
        raise SimulationError(f"no scene was accepted in {sampled.attempts} attempts ({reasons})")
    return sampled.scene


@contextmanager
def drake_errors() -> Iterator[None]:
    """Around what Drake does: a failed condition of its own ends this alone.

    Raises:
        SimulationError: in the place of `SystemExit`.
    """
    try:
        yield
    except SystemExit as error:  # DRAKE_DEMAND ends this way
        raise SimulationError(f"Drake failed: {error}") from error


@lru_cache(maxsize=1)
def _sampler(inputs: DatasetInputs) -> SceneSampler:
    assert inputs.recipe.sampled is not None and inputs.library is not None
    return SceneSampler(
        inputs.recipe.sampled, load_library(inputs.library), _station(inputs.station)
    )


@lru_cache(maxsize=1)
def _station(path: Path) -> Station:
    return load_station(path)
