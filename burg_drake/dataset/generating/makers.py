"""Who makes the samples of scenes: processes of this machine, or the workers of a cluster."""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import partial

from burg_drake.core import BurgError, InvalidInputError
from burg_drake.core.paths import PACKAGE_URI
from burg_drake.core.workers import map_unordered
from burg_drake.dataset.blender import blender
from burg_drake.dataset.generating.contents import run_folder
from burg_drake.dataset.generating.recipe import DatasetRecipe
from burg_drake.dataset.generating.sent_scene import MadeScene, SentScene, make_sent_scene
from burg_drake.dataset.generating.work import SceneWork, given_scene, make_scene
from burg_drake.dataset.labels import grasps_of_run
from burg_drake.dataset.samples import ShardEntry, write_made_scene
from burg_drake.evaluation.cluster import DaskExecutor, connect_cluster, map_on_cluster
from burg_drake.evaluation.cluster.bundles import make_bundle
from burg_drake.evaluation.store import open_results
from burg_drake.objects.library import ObjectLibrary
from burg_drake.scene.document import Instance, Scene, SceneDocument
from burg_drake.station.document import Station

Made = Generator[tuple[SceneWork, ShardEntry | BaseException], None, None]
"""Scenes with their lines of the index, or why they have none, as they come."""


@contextmanager
def scene_maker(
    cluster: str | None,
    workers: int,
    recipe: DatasetRecipe,
    library: ObjectLibrary,
    station: Station,
) -> Iterator[Callable[[Sequence[SceneWork]], Made]]:
    """What writes scenes and their samples, until the block is left.

    Args:
        cluster: see `connect_cluster`; this machine if None.
        workers: number of processes of this machine.
        recipe: of the data set.
        library: of all scenes.
        station: what they stand on.

    Raises:
        InvalidInputError: a cluster cannot make what the recipe asks for.
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
) -> Made:
    scenes: dict[int, Scene] = {}
    able = []
    for one in work:
        try:
            if one.path is not None:
                scenes[one.number] = given_scene(one, lambda *reference: library)
            able.append(one)
        except BurgError as error:
            yield one, error
    if not able:
        return
    world = make_bundle(catalogue(library, scenes.values()), station, looks=True)
    run = open_results(run_folder(recipe, able[0].inputs.folder)) if recipe.run else None
    version = blender().version if recipe.colors and recipe.renderer == "blender" else ""
    sent = replace(recipe, given=(), run="")

    def pack(one: SceneWork) -> SentScene:
        scene, grasps = scenes.get(one.number), None
        if scene is not None and run is not None:
            grasps = grasps_of_run(run, scene)
        document, path = (scene.document, scene.path) if scene else (None, one.inputs.folder)
        return SentScene(
            replace(world, data=b""), sent, one.number, document, path, grasps, version
        )

    with closing(map_on_cluster(executor, make_sent_scene, able, world, pack)) as answers:
        for one, made in answers:
            yield one, made if isinstance(made, BaseException) else _kept(one, library, made)


def catalogue(library: ObjectLibrary, scenes: Collection[Scene]) -> Scene:
    """A scene of all objects of some scenes, to be packed; of the whole library if there are none,
    as scenes are sampled from that."""
    used = {one.object for scene in scenes for one in scene.document.instances}
    used |= {one.object for scene in scenes for one in scene.document.background}
    objects = [Instance(object=name) for name in library.objects if name in used or not scenes]
    document = SceneDocument(name="objects", library="", background=tuple(objects))
    return Scene(document, library, library.root)


def _kept(work: SceneWork, library: ObjectLibrary, made: MadeScene) -> ShardEntry | BaseException:
    """Writes what a worker has made."""
    folder = work.inputs.folder
    scene = Scene(made.document, library, folder)
    try:
        return write_made_scene(folder, work.number, scene, made.shard, made.entry)
    except BurgError as error:
        return error
