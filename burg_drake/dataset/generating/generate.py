"""Data sets: samples of many scenes, by several processes, in a folder that can be continued."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from burg_drake.core import (
    BurgError,
    InvalidInputError,
    MissingDependencyError,
    one_line,
    software_versions,
)
from burg_drake.core.paths import name_from, portable_reference
from burg_drake.core.workers import worker_count
from burg_drake.dataset.blender import blender
from burg_drake.dataset.exchange import CARD, write_card
from burg_drake.dataset.generating.contents import (
    HASH_DIGITS,
    distractors_content,
    library_content,
    portable_recipe,
)
from burg_drake.dataset.generating.makers import scene_maker
from burg_drake.dataset.generating.recipe import DatasetRecipe
from burg_drake.dataset.generating.work import DatasetInputs, SceneWork
from burg_drake.dataset.samples import DatasetDocument, DatasetWriter, load_dataset
from burg_drake.dataset.views import require_cameras
from burg_drake.evaluation.store import open_results
from burg_drake.objects.library import ObjectLibrary
from burg_drake.scene.document import SceneLike, as_scene
from burg_drake.station.document import Station, StationLike, as_station
from burg_drake.system_libraries import describe_missing, missing_render_libraries

PACKAGES = {
    "drake": "drake",
    "numpy": "numpy",
    "scipy": "scipy",
    "embreex": "embreex",
    "opencv": "opencv-python-headless",
}
"""What decides about samples, as it is called in `dataset.yaml` and installed."""


@dataclass(frozen=True)
class GeneratedDataset:
    """What is in a folder after generating.

    Attributes:
        folder: of the data set.
        new: numbers of the scenes whose samples were made now.
        known: of those that were there already.
        failed: one line for each scene that has no samples, by number: they are tried again the
            next time.
    """

    folder: Path
    new: tuple[int, ...]
    known: tuple[int, ...]
    failed: dict[int, str]


def generate_dataset(
    scenes: Sequence[SceneLike] | ObjectLibrary,
    station: StationLike,
    folder: str | Path,
    recipe: DatasetRecipe | None = None,
    *,
    count: int | None = None,
    workers: int = 1,
    cluster: str | None = None,
    progress: Callable[[int, str], None] | None = None,
) -> GeneratedDataset:
    """Makes the samples of many scenes, but for those that the folder has.

    Example::

        recipe = burg.dataset.DatasetRecipe(views=20)
        burg.generate_dataset(["tabletop_six"], "panda_tabletop", "my_dataset", recipe)

    Args:
        scenes: given ones, with files, all of one library; or the library that scenes are sampled
            from, as `recipe.sampled` says.
        station: what they stand on.
        folder: of the data set; new, or one that this function has begun.
        recipe: how samples are made.
        count: of sampled scenes.
        workers: number of processes; with one this process does it.
        cluster: in their place, workers of Dask, which need none of this machine's files: as
            `burg.runs.connect_cluster` takes it, such as `local:4` or the path of a cluster file.
        progress: called after each scene with its number and what has gone wrong, if anything.

    Returns:
        What is there now. A scene that cannot be sampled or rendered leaves the others as they are.

    Raises:
        InvalidInputError: the folder holds another data set, is being written or is full, a scene
            has no file, the scenes are of several libraries, or there is no such run; a number is
            below 1.
        UnknownNameError: the station has no such camera, or there is no library of distractors.
        MissingDependencyError: the recipe has colours, and what renders them is missing; or Dask is
            asked for, and not installed.
        ClusterError: no scheduler is reached, or it is lost; a worker has other versions; scenes
            that are there stay, and the same call continues.
    """
    station, recipe = as_station(station), recipe or DatasetRecipe()
    paths: Sequence[Path | None]
    workers, folder = worker_count(workers), Path(folder)
    if isinstance(scenes, ObjectLibrary):
        if recipe.sampled is None or count is None or count < 1:
            raise InvalidInputError(
                "to sample scenes, give a recipe of sampled scenes and a count of 1 or more"
            )
        library, paths = scenes, [None] * count
    elif count is not None:
        raise InvalidInputError(
            "count is for sampled scenes; leave it out, all given scenes are used"
        )
    else:
        library, recipe, paths = _given(scenes, recipe)
    _require_possible(recipe, station)
    recipe = portable_recipe(recipe, folder)
    document = _document(folder, library, station, recipe)
    with (
        scene_maker(cluster, workers, recipe, library, station) as make,
        DatasetWriter(folder, document) as writer,
    ):
        root = library.root if recipe.sampled is not None else None
        inputs = DatasetInputs(recipe, writer.folder, station.path, root)
        writer.discard_damaged()
        missing = writer.missing(range(len(paths)))
        failed: dict[int, str] = {}
        work = [SceneWork(inputs, number, paths[number]) for number in missing]
        with closing(make(work)) as made:
            for one, outcome in made:
                if isinstance(outcome, BurgError) and "folder" in outcome.arguments:
                    raise outcome  # a full disk is so for all others, too
                if isinstance(outcome, BaseException):
                    failed[one.number] = (
                        str(outcome) if isinstance(outcome, BurgError) else one_line(outcome)
                    )
                else:
                    writer.added(outcome)
                if progress is not None:
                    progress(one.number, failed.get(one.number, ""))
        writer.finish()
        if len(failed) < len(missing) or not (folder / CARD).exists():
            _write_card(folder, recipe)
    new = tuple(number for number in missing if number not in failed)
    known = tuple(number for number in range(len(paths)) if number not in missing)
    return GeneratedDataset(folder, new, known, dict(sorted(failed.items())))


def _require_possible(recipe: DatasetRecipe, station: Station) -> None:
    """Refuses what no scene can have samples with, before a folder is made."""
    require_cameras(recipe.viewpoints, station)
    if recipe.run:
        open_results(recipe.run)
    if not recipe.colors:
        return
    if recipe.renderer == "blender":
        blender()
    elif missing := missing_render_libraries():
        raise MissingDependencyError(
            "the recipe has colour images, which cannot be rendered (colors=False leaves them"
            f" out): {describe_missing(missing)}"
        )


def _given(
    scenes: Sequence[SceneLike], recipe: DatasetRecipe
) -> tuple[ObjectLibrary, DatasetRecipe, list[Path]]:
    """The library of given scenes, the recipe with their contents, and their files."""
    if recipe.sampled is not None:
        raise InvalidInputError(
            "scenes are given, but the recipe samples scenes; leave one of the two out"
        )
    loaded = [as_scene(scene) for scene in scenes]
    if not loaded:
        raise InvalidInputError("no scenes are given; give at least one")
    library = loaded[0].library
    for scene in loaded:
        if scene.library.root.resolve() != library.root.resolve():
            raise InvalidInputError(
                f"{scene.path} uses library {scene.library.root}, but {loaded[0].path} uses"
                f" {library.root}; a data set has one library"
            )
        if not scene.path.is_file():
            raise InvalidInputError(f"scene {scene.name!r} has no file; save it first")
    given = tuple(scene.content for scene in loaded)
    return library, replace(recipe, given=given), [scene.path for scene in loaded]


def _document(
    folder: Path, library: ObjectLibrary, station: Station, recipe: DatasetRecipe
) -> DatasetDocument:
    name = name_from(folder.resolve().name)
    versions = software_versions(PACKAGES)
    if recipe.renderer == "blender":
        versions["blender"] = blender().version
    return DatasetDocument(
        name=name,
        objects=tuple(library.objects),
        library=portable_reference(library.root, folder),
        station=portable_reference(station.path, folder),
        library_content=library_content(library),
        station_content=station.content[:HASH_DIGITS],
        distractors_content=distractors_content(recipe, folder),
        versions=versions,
        recipe=recipe.plain(),
    )


def _write_card(folder: Path, recipe: DatasetRecipe) -> None:
    dataset = load_dataset(folder)
    if not len(dataset):
        return
    facts = {"seed": str(recipe.seed), "views of each scene": str(recipe.views)}
    if recipe.sensor:
        facts["sensor"] = recipe.sensor
    if not recipe.colors:
        facts["colours"] = "none"
    write_card(dataset, folder, facts=facts)
