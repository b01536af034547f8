"""Makes the samples of one scene, locally or on a remote worker."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from burg_drake.cameras import depth_noise, noisy_depth, sensor
from burg_drake.core import InvalidInputError, SimulationError, rng_from
from burg_drake.dataset.appearance import Appearance, read_appearance
from burg_drake.dataset.appearance_sampling import distractor_boxes, draw_appearance
from burg_drake.dataset.blender_process import running_blender
from burg_drake.dataset.recipe import DatasetRecipe, resolve_library_path, run_folder
from burg_drake.dataset.sample import Images, Sample
from burg_drake.dataset.scene_grasps import SceneGrasps, grasps_of_run, label_grasps, sampled_grasps
from burg_drake.dataset.scene_renderer import ImageKind, SceneRenderer, label_instances
from burg_drake.dataset.shards import ShardEntry, shard_name, write_shard
from burg_drake.dataset.view_sampler import ViewSampler
from burg_drake.dataset.views import View
from burg_drake.dataset.writer import write_scene
from burg_drake.evaluation import Bundle, load_bundle, require_same_content
from burg_drake.generation import SceneSampler, convert_drake_errors, kept_sampler
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.scene import Scene, SceneDocument, SceneRecipe, load_scene
from burg_drake.station import Station, load_station


class SceneSamples:
    """Makes the samples of one scene.

    Args:
        scene: the scene.
        scene_number: number of the scene in the data set; seeds views, noise and appearance.
        station: station of the scene.
        recipe: recipe of the samples.
        folder: folder of the data set; the recipe's paths are relative to it.
        appearance: appearance of the scene; drawn by the recipe if None.
        grasps: grasps on the scene's objects; sampled or read by the recipe if None.
    """

    def __init__(
        self,
        scene: Scene,
        scene_number: int,
        station: Station,
        recipe: DatasetRecipe,
        folder: Path,
        appearance: Appearance | None = None,
        grasps: SceneGrasps | None = None,
    ) -> None:
        self._scene, self._scene_number, self._folder = scene, scene_number, folder
        self._station, self._recipe, self._grasps = station, recipe, grasps
        looks = recipe.looks
        if appearance is None and looks is not None:
            rng = rng_from("dataset looks", recipe.seed, scene_number)
            distractor_library = resolve_library_path(looks.distractor_library, folder)
            settings = replace(looks, distractor_library=distractor_library)
            drawn = draw_appearance(settings, scene, station, rng)
            appearance = replace(drawn, library=looks.distractor_library)
        # Samples record the recipe's reference to the distractors; renderers need the folder.
        self._recorded_appearance = appearance
        if appearance is not None:
            library_folder = resolve_library_path(appearance.library, folder)
            appearance = replace(appearance, library=library_folder)
        self._appearance = appearance
        self._renderers: dict[tuple[bool, bool], SceneRenderer] = {}

    def __iter__(self) -> Iterator[Sample]:
        """Makes the samples one by one.

        Raises:
            InvalidInputError: no view of the scene fulfils the rules.
        """
        recipe, intrinsics, depth_range = self._recipe, None, None
        if recipe.sensor:
            device = sensor(recipe.sensor)
            intrinsics, depth_range = device.depth_camera(recipe.size), device.depth_range
        views = ViewSampler(
            self._scene,
            self._station,
            recipe.viewpoints,
            intrinsics=intrinsics,
            depth_range=depth_range,
            besides=() if self._appearance is None else distractor_boxes(self._appearance),
        )
        grasps = self._scene_grasps() if self._grasps is None else self._grasps
        for view_number in range(recipe.views):
            rng = rng_from("dataset view", recipe.seed, self._scene_number, view_number)
            yield self.sample(view_number, views.sample(rng), grasps)

    def sample(self, view_number: int, view: View, grasps: SceneGrasps | None = None) -> Sample:
        """Makes the sample of a view.

        Args:
            view_number: number of the view in the scene; seeds the noise.
            view: pose and intrinsics of the camera.
            grasps: grasps on the scene's objects.
        """
        recipe, renderer = self._recipe, self._renderer(view, self._recipe.colors)
        rng = rng_from("dataset image", recipe.seed, self._scene_number, view_number)
        kinds: list[ImageKind] = ["depth", "labels"]
        if recipe.colors:
            kinds.append("color")
        if recipe.normals or recipe.sensor:
            kinds.append("normals")
        images = renderer.images(view, kinds, rng=rng)
        appearance = self._recorded_appearance
        return Sample(
            scene=self._scene_number,
            number=view_number,
            view=view,
            X_WS=self._station.document.X_WS.matrix(),
            images=images if recipe.normals else replace(images, normals=None),
            sensor_depth=self._sensor_depth(view, images, rng) if recipe.sensor else None,
            instances=label_instances(renderer, view, images),
            grasps=None if grasps is None else label_grasps(grasps, self._scene, view.X_SC),
            appearance={} if appearance is None else appearance.plain(),
        )

    def render_again(self, view: View) -> Images:
        """Renders depth and labels of a view, to compare them with the stored images."""
        return self._renderer(view, colors=False).images(view, ("depth", "labels"))

    def _renderer(self, view: View, colors: bool) -> SceneRenderer:
        arm = view.posture is not None
        if (arm, colors) not in self._renderers:
            self._renderers[arm, colors] = SceneRenderer(
                self._scene,
                self._station,
                appearance=self._appearance,
                arm=arm,
                colors=colors,
                renderer=self._recipe.renderer,
            )
        return self._renderers[arm, colors]

    def _sensor_depth(self, view: View, images: Images, rng: np.random.Generator) -> np.ndarray:
        assert images.depth is not None
        return noisy_depth(
            images.depth,
            depth_noise(self._recipe.sensor),
            view.intrinsics,
            rng,
            normals=images.normals,
            color=images.color,
        )

    def _scene_grasps(self) -> SceneGrasps | None:
        recipe = self._recipe
        if recipe.run:
            return grasps_of_run(run_folder(recipe, self._folder), self._scene)
        if recipe.grasps_per_object:
            return sampled_grasps(self._scene, self._station, recipe.grasps_per_object, recipe.seed)
        return None


def appearance_of(sample: Sample) -> Appearance | None:
    """Appearance of a sample, from the data stored with it.

    Raises:
        DocumentError: the data are invalid.
    """
    if not sample.appearance:
        return None
    return read_appearance(sample.appearance, f"appearance of {sample.key}")


@dataclass(frozen=True)
class SceneWork:
    """A scene to make samples of on this machine; scene, station and library are given by path.

    Attributes:
        scene_number: number of the scene.
        path: path of the scene's document; None for a sampled scene.
        recipe: recipe of the data set.
        folder: folder of the data set.
        station: file of the station.
        library: library folder for a sampled scene; None for a given one.
    """

    scene_number: int
    path: Path | None
    recipe: DatasetRecipe
    folder: Path
    station: Path
    library: Path | None


def make_scene(work: SceneWork) -> ShardEntry:
    """Writes a scene and its samples.

    Raises:
        SimulationError: no scene was accepted, or an assertion of Drake failed.
        Exception: the scene cannot be rendered.
    """
    recipe = work.recipe
    with convert_drake_errors():
        station = _load_station(work.station)
        if work.path is not None:
            scene = load_unchanged_scene(work)
        else:
            assert recipe.sampled is not None and work.library is not None
            sampler = kept_sampler(recipe.sampled, work.library, work.station)
            scene = sample_scene(sampler, work.scene_number, work.folder)
        samples = SceneSamples(scene, work.scene_number, station, recipe, work.folder)
        return write_scene(work.folder, work.scene_number, scene, samples)


def load_unchanged_scene(
    work: SceneWork, library: Callable[[str, Path | None], ObjectLibrary] = load_library
) -> Scene:
    """Loads a given scene, whose content must match the hash in the recipe.

    Args:
        work: the scene, with a path.
        library: as in `load_scene`.

    Raises:
        InvalidInputError: the scene has changed.
        UnknownNameError, DocumentError: as `load_scene`.
    """
    assert work.path is not None
    scene = load_scene(work.path, library=library)
    if scene.content != work.recipe.given[work.scene_number]:
        raise InvalidInputError(
            f"{work.path} was changed while the data set was made; run the command again"
        )
    return scene


def sample_scene(sampler: SceneSampler, scene_number: int, folder: Path) -> Scene:
    """Samples a scene.

    Args:
        sampler: sampler of the recipe.
        scene_number: number of the scene; seeds the sampler.
        folder: folder of the data set.

    Raises:
        SimulationError: no attempt was accepted.
    """
    sampled = sampler.sample(scene_number, folder / "scenes")
    if not sampled.accepted:
        reasons = ", ".join(f"{count} x {reason}" for reason, count in sampled.refused.items())
        raise SimulationError(f"no scene was accepted in {sampled.attempts} attempts ({reasons})")
    return sampled.scene


@lru_cache(maxsize=1)
def _load_station(path: Path) -> Station:
    return load_station(path)


@dataclass(frozen=True)
class SampleTask:
    """A scene to make samples of on a remote worker; needs no files but the unpacked bundle.

    Attributes:
        world: hashes of the bundle with station and library, without file contents.
        recipe: recipe of the data set, without other scenes and without references to files.
        scene_number: number of the scene.
        document: document of the scene; None for a sampled scene.
        path: for messages: path of the document, or of the data set for a sampled scene, on the
            machine that writes the data set.
        grasps: grasps on the scene's objects; sampled by the recipe if None.
        blender: version of Blender, if Blender renders.
    """

    world: Bundle
    recipe: DatasetRecipe
    scene_number: int
    document: SceneDocument | None
    path: Path
    grasps: SceneGrasps | None
    blender: str = ""


@dataclass(frozen=True)
class SampleTaskResult:
    """Result of a `SampleTask`.

    Attributes:
        document: document of the scene.
        shard: bytes of the shard.
        entry: the shard's entry in the index.
    """

    document: SceneDocument
    shard: bytes
    entry: ShardEntry


def run_sample_task(task: SampleTask, folder: Path) -> SampleTaskResult:
    """Makes the samples of a scene on a remote worker.

    Args:
        task: the scene.
        folder: folder of the unpacked bundle.

    Raises:
        Exception: as `make_scene`; or the bundle has other content than the task expects.
    """
    if task.blender and (version := running_blender().version) != task.blender:
        raise InvalidInputError(
            f"the worker has Blender {version}, but the data set is made with {task.blender};"
            " install that version"
        )
    with convert_drake_errors():
        library, station = _load_world(task.world, folder)
        if task.document is not None:
            scene = Scene(task.document, library, task.path)
        else:
            assert task.recipe.sampled is not None
            sampler = _bundle_scene_sampler(task.recipe.sampled, task.world, folder)
            scene = sample_scene(sampler, task.scene_number, task.path)
        samples = SceneSamples(
            scene, task.scene_number, station, task.recipe, folder, grasps=task.grasps
        )
        # beside the bundle, where this machine has disk space and old folders are removed
        with TemporaryDirectory(dir=folder.parent, prefix=".samples.") as place:
            path = Path(place) / shard_name(task.scene_number)
            entry = write_shard(path, samples)
            return SampleTaskResult(scene.document, path.read_bytes(), entry)


@lru_cache(maxsize=1)
def _load_world(world: Bundle, folder: Path) -> tuple[ObjectLibrary, Station]:
    scene, station = load_bundle(folder)
    require_same_content(world, scene, station)
    return scene.library, station


@lru_cache(maxsize=1)
def _bundle_scene_sampler(recipe: SceneRecipe, world: Bundle, folder: Path) -> SceneSampler:
    return SceneSampler(recipe, *_load_world(world, folder))
