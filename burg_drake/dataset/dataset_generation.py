"""Generates data sets with local processes or a cluster, and reproduces single samples."""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from burg_drake.core import (
    PACKAGE_URI,
    BurgError,
    InvalidInputError,
    MissingDependencyError,
    make_name,
    map_unordered,
    one_line,
    portable_reference,
    software_versions,
    worker_count,
)
from burg_drake.dataset.blender_process import running_blender
from burg_drake.dataset.checks import DatasetFinding, check_dataset
from burg_drake.dataset.dataset_card import CARD_FILE, write_card
from burg_drake.dataset.document import DATASET_FILE, DatasetDocument, load_dataset_document
from burg_drake.dataset.reader import Dataset, load_dataset
from burg_drake.dataset.recipe import (
    CONTENT_DIGITS,
    DatasetRecipe,
    distractors_content,
    library_content,
    portable_recipe,
    read_recipe,
    require_same_contents,
    run_folder,
)
from burg_drake.dataset.sample import Images, Sample
from burg_drake.dataset.scene_grasps import grasps_of_run
from burg_drake.dataset.scene_samples import (
    SampleTask,
    SceneSamples,
    SceneWork,
    appearance_of,
    load_unchanged_scene,
    make_scene,
    run_sample_task,
)
from burg_drake.dataset.shards import ShardEntry
from burg_drake.dataset.view_sampler import require_cameras
from burg_drake.dataset.writer import DatasetWriter, write_made_scene
from burg_drake.evaluation import (
    DaskExecutor,
    connect_cluster,
    make_bundle,
    map_on_cluster,
    open_results,
)
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import Instance, Scene, SceneDocument, SceneLike, as_scene
from burg_drake.station import Station, StationLike, as_station
from burg_drake.system_libraries import describe_missing, missing_render_libraries

SceneResults = Generator[tuple[SceneWork, ShardEntry | BaseException], None, None]
"""Scenes in order of completion, with their entries of the index or their errors."""


@contextmanager
def scene_maker(
    cluster: str | None,
    workers: int,
    recipe: DatasetRecipe,
    library: ObjectLibrary,
    station: Station,
) -> Iterator[Callable[[Sequence[SceneWork]], SceneResults]]:
    """A function that writes scenes and their samples, within the block.

    Args:
        cluster: see `connect_cluster`; this machine if None.
        workers: number of local processes.
        recipe: recipe of the data set.
        library: library of all scenes.
        station: station of the scenes.

    Raises:
        InvalidInputError: the recipe cannot be made on a cluster.
        BurgError: see `connect_cluster`.
    """
    if cluster is None:
        yield lambda work: map_unordered(make_scene, work, workers)
        return
    if recipe.sampled is not None and recipe.run:
        raise InvalidInputError(
            "on a cluster, grasps of a run can only be used for given scenes; sample the scenes"
            " first, or give no cluster"
        )
    if recipe.looks is not None and not recipe.looks.distractor_library.startswith(PACKAGE_URI):
        raise InvalidInputError(
            f"library of distractors {recipe.looks.distractor_library} is not available on the"
            " cluster; give a built-in library"
        )
    with connect_cluster(cluster) as executor:
        yield partial(_make_on_cluster, executor, recipe, library, station)


def _make_on_cluster(
    executor: DaskExecutor,
    recipe: DatasetRecipe,
    library: ObjectLibrary,
    station: Station,
    work: Sequence[SceneWork],
) -> SceneResults:
    scenes: dict[int, Scene] = {}
    able = []
    for one in work:
        try:
            if one.path is not None:
                scenes[one.scene_number] = load_unchanged_scene(one, lambda *reference: library)
            able.append(one)
        except BurgError as error:
            yield one, error
    if not able:
        return
    world = make_bundle(catalogue_scene(library, scenes.values()), station, looks=True)
    run = open_results(run_folder(recipe, able[0].folder)) if recipe.run else None
    version = running_blender().version if recipe.colors and recipe.renderer == "blender" else ""
    task_recipe = replace(recipe, given=(), run="")

    def pack(one: SceneWork) -> SampleTask:
        scene, grasps = scenes.get(one.scene_number), None
        if scene is not None and run is not None:
            grasps = grasps_of_run(run, scene)
        document, path = (scene.document, scene.path) if scene else (None, one.folder)
        return SampleTask(
            replace(world, data=b""), task_recipe, one.scene_number, document, path, grasps, version
        )

    with closing(map_on_cluster(executor, run_sample_task, able, world, pack)) as answers:
        for one, made in answers:
            if isinstance(made, BaseException):
                yield one, made
                continue
            folder = one.folder
            scene = Scene(made.document, library, folder)
            try:
                entry = write_made_scene(folder, one.scene_number, scene, made.shard, made.entry)
            except BurgError as error:
                yield one, error
            else:
                yield one, entry


def catalogue_scene(library: ObjectLibrary, scenes: Collection[Scene]) -> Scene:
    """A scene with all objects of some scenes, for packing; without scenes, which are then sampled,
    with all objects of the library."""
    used = {one.object for scene in scenes for one in scene.document.instances}
    used |= {one.object for scene in scenes for one in scene.document.background}
    objects = [Instance(object=name) for name in library.objects if name in used or not scenes]
    document = SceneDocument(name="objects", library="", background=tuple(objects))
    return Scene(document, library, library.root)


@dataclass(frozen=True)
class GeneratedDataset:
    """Contents of a folder after generating.

    Attributes:
        folder: folder of the data set.
        new: numbers of the scenes whose samples were made now.
        known: numbers of the scenes that existed already.
        failed: error message of each scene without samples, by number. The next call tries these
            scenes again.
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
    """Makes the samples of many scenes; skips scenes that the folder has.

    Example::

        recipe = burg.dataset.DatasetRecipe(views=20)
        burg.generate_dataset(["tabletop_six"], "panda_tabletop", "my_dataset", recipe)

    Args:
        scenes: given scenes with files, all of one library; or the library from which scenes are
            sampled by `recipe.sampled`.
        station: station of the scenes.
        folder: folder of the data set; new, or begun by this function.
        recipe: recipe of the samples.
        count: number of sampled scenes.
        workers: number of processes; with one, this process makes the samples.
        cluster: workers of Dask instead of local processes; they need none of this machine's files.
            See `burg.runs.connect_cluster`: for example `local:4` or the path of a cluster file.
        progress: called after each scene with its number and its error message, if any.

    Returns:
        Contents of the folder. A scene that cannot be sampled or rendered does not affect others.

    Raises:
        InvalidInputError: the folder holds another data set or is being written, the disk is full,
            a scene has no file, the scenes are of several libraries, there is no such run, or a
            number is below 1.
        UnknownNameError: the station has no such camera, or there is no library of distractors.
        MissingDependencyError: the recipe has colours, and their renderer is missing; or `cluster`
            is given, and Dask is not installed.
        ClusterError: the scheduler cannot be reached or is lost, or a worker has other versions.
            Finished scenes stay, and the same call resumes.
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
        library, recipe, paths = _load_given_scenes(scenes, recipe)
    _require_feasible_recipe(recipe, station)
    recipe = portable_recipe(recipe, folder)
    document = _new_document(folder, library, station, recipe)
    with (
        scene_maker(cluster, workers, recipe, library, station) as make,
        DatasetWriter(folder, document) as writer,
    ):
        root = library.root if recipe.sampled is not None else None
        writer.discard_damaged()
        missing = writer.missing(range(len(paths)))
        failed: dict[int, str] = {}
        work = [
            SceneWork(number, paths[number], recipe, writer.folder, station.path, root)
            for number in missing
        ]
        with closing(make(work)) as made:
            for one, outcome in made:
                if isinstance(outcome, BurgError) and "folder" in outcome.arguments:
                    raise outcome  # a full disk makes all other scenes fail, too
                if isinstance(outcome, BaseException):
                    failed[one.scene_number] = (
                        str(outcome) if isinstance(outcome, BurgError) else one_line(outcome)
                    )
                else:
                    writer.add_entry(outcome)
                if progress is not None:
                    progress(one.scene_number, failed.get(one.scene_number, ""))
        writer.finish()
        if len(failed) < len(missing) or not (folder / CARD_FILE).exists():
            _write_card(folder, recipe)
    new = tuple(number for number in missing if number not in failed)
    known = tuple(number for number in range(len(paths)) if number not in missing)
    return GeneratedDataset(folder, new, known, dict(sorted(failed.items())))


def _require_feasible_recipe(recipe: DatasetRecipe, station: Station) -> None:
    """Refuses a recipe that fails for every scene, before a folder is created."""
    require_cameras(recipe.viewpoints, station)
    if recipe.run:
        open_results(recipe.run)
    if not recipe.colors:
        return
    if recipe.renderer == "blender":
        running_blender()
    elif missing := missing_render_libraries():
        raise MissingDependencyError(
            "the recipe has colour images, which cannot be rendered (colors=False leaves them"
            f" out): {describe_missing(missing)}"
        )


def _load_given_scenes(
    scenes: Sequence[SceneLike], recipe: DatasetRecipe
) -> tuple[ObjectLibrary, DatasetRecipe, list[Path]]:
    """Library of given scenes, recipe with the hashes of the scenes, and files of the scenes."""
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


def _new_document(
    folder: Path, library: ObjectLibrary, station: Station, recipe: DatasetRecipe
) -> DatasetDocument:
    # Installed packages that affect samples, by their names in the document.
    packages = {
        "drake": "drake",
        "numpy": "numpy",
        "scipy": "scipy",
        "embreex": "embreex",
        "opencv": "opencv-python-headless",
    }
    name = make_name(folder.resolve().name)
    versions = software_versions(packages)
    if recipe.renderer == "blender":
        versions["blender"] = running_blender().version
    return DatasetDocument(
        name=name,
        objects=tuple(library.objects),
        library=portable_reference(library.root, folder),
        station=portable_reference(station.path, folder),
        library_content=library_content(library),
        station_content=station.content[:CONTENT_DIGITS],
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


def sample_again(dataset: Dataset, key: str) -> Sample:
    """Renders one sample of a generated data set again, from its stored view and appearance.

    Args:
        dataset: data set made by `generate_dataset`.
        key: key of the sample, such as `000012_003`.

    Returns:
        The sample with the same images, byte for byte with the same software; without grasps.

    Raises:
        UnknownNameError: no such sample.
        InvalidInputError: the data set was not generated, or its library or station has changed.
    """
    stored = dataset.read(dataset.index(key), images=())
    recipe, station = _recipe_and_station(dataset.document, dataset.folder)
    scene = dataset.scene(stored.scene)
    samples = SceneSamples(
        scene, stored.scene, station, recipe, dataset.folder, appearance_of(stored)
    )
    return samples.sample(stored.number, stored.view)


def check_generated(folder: str | Path) -> list[DatasetFinding]:
    """Finds all errors of a data set; renders depth and labels again and compares them.

    Args:
        folder: folder of a data set made by `generate_dataset`; or with `DatasetWriter`, whose
            images are not rendered again.

    Raises:
        DocumentError: its document is missing, damaged, or of another version.
    """
    folder = Path(folder)
    document = load_dataset_document(folder / DATASET_FILE)
    if document.recipe is None:
        return check_dataset(folder)
    try:
        recipe, station = _recipe_and_station(document, folder)
    except BurgError as error:
        return [DatasetFinding("", DATASET_FILE, str(error)), *check_dataset(folder)]

    last: list[tuple[tuple[int, str], SceneSamples]] = []

    def redraw(scene: Scene, sample: Sample) -> Images:
        key = sample.scene, repr(sample.appearance)
        if not last or last[0][0] != key:
            appearance = appearance_of(sample)
            samples = SceneSamples(scene, sample.scene, station, recipe, folder, appearance)
            last[:] = [(key, samples)]
        return last[0][1].render_again(sample.view)

    return check_dataset(folder, redraw)


def _recipe_and_station(document: DatasetDocument, folder: Path) -> tuple[DatasetRecipe, Station]:
    if document.recipe is None:
        raise InvalidInputError(
            f"{folder} has no recipe in its document, so its samples cannot be made again"
        )
    recipe = read_recipe(document.recipe, f"recipe of {folder}")
    return recipe, require_same_contents(document, recipe, folder)
