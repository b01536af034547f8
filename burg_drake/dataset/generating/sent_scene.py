"""A scene whose samples another machine makes, and what that sends back: neither needs a file of
the data set there, but for a bundle of station and library."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

from burg_drake.core import InvalidInputError
from burg_drake.dataset.blender import blender
from burg_drake.dataset.generating.recipe import DatasetRecipe
from burg_drake.dataset.generating.scene_samples import SceneSamples
from burg_drake.dataset.generating.work import accepted_scene, drake_errors
from burg_drake.dataset.labels import SceneGrasps
from burg_drake.dataset.samples import ShardEntry, shard_name, write_shard
from burg_drake.evaluation.cluster.bundles import Bundle, load_bundle, require_content
from burg_drake.generation import SceneSampler
from burg_drake.objects.library import ObjectLibrary
from burg_drake.scene.document import Scene, SceneDocument, SceneRecipe
from burg_drake.station.document import Station


@dataclass(frozen=True)
class SentScene:
    """A scene to make samples of.

    Attributes:
        world: hashes of the bundle with station and library, without data.
        recipe: of the data set, without what is of other scenes or needs files.
        number: of the scene.
        document: of it; None if it is sampled.
        path: of the document on the machine of the data set; of the data set for a sampled scene.
            Only messages have it.
        grasps: on its objects; those that the recipe asks for if None.
        blender: version of Blender, if that renders.
    """

    world: Bundle
    recipe: DatasetRecipe
    number: int
    document: SceneDocument | None
    path: Path
    grasps: SceneGrasps | None
    blender: str = ""


@dataclass(frozen=True)
class MadeScene:
    """What has become of it.

    Attributes:
        document: of the scene.
        shard: bytes of its shard.
        entry: the shard's line of the index.
    """

    document: SceneDocument
    shard: bytes
    entry: ShardEntry


def make_sent_scene(sent: SentScene, folder: Path) -> MadeScene:
    """Makes the samples of a scene, on any machine.

    Args:
        sent: the scene.
        folder: where its world is unpacked.

    Raises:
        Exception: as `work.make_scene`; or the world is not the one that was sent.
    """
    if sent.blender and (version := blender().version) != sent.blender:
        raise InvalidInputError(
            f"the worker has Blender {version}, but the data set is made with {sent.blender};"
            " install that version"
        )
    with drake_errors():
        library, station = _world(sent.world, folder)
        if sent.document is not None:
            scene = Scene(sent.document, library, sent.path)
        else:
            assert sent.recipe.sampled is not None
            sampler = _sampler(sent.recipe.sampled, sent.world, folder)
            scene = accepted_scene(sampler, sent.number, sent.path)
        samples = SceneSamples(scene, sent.number, station, sent.recipe, folder, grasps=sent.grasps)
        # beside the bundle, as that is where this machine has room, and old folders are removed
        with TemporaryDirectory(dir=folder.parent, prefix=".samples.") as place:
            path = Path(place) / shard_name(sent.number)
            entry = write_shard(path, samples)
            return MadeScene(scene.document, path.read_bytes(), entry)


@lru_cache(maxsize=1)
def _world(world: Bundle, folder: Path) -> tuple[ObjectLibrary, Station]:
    scene, station = load_bundle(folder)
    require_content(world, scene, station)
    return scene.library, station


@lru_cache(maxsize=1)
def _sampler(recipe: SceneRecipe, world: Bundle, folder: Path) -> SceneSampler:
    return SceneSampler(recipe, *_world(world, folder))
