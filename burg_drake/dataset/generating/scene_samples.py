"""All samples of one scene, one after the other; each can be made again alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from burg_drake.cameras.noise import depth_noise, noisy_depth
from burg_drake.cameras.optics import sensor
from burg_drake.core import rng_from
from burg_drake.dataset.appearance import (
    Appearance,
    distractor_boxes,
    draw_appearance,
    read_appearance,
)
from burg_drake.dataset.generating.contents import placed_library, run_folder
from burg_drake.dataset.generating.recipe import DatasetRecipe
from burg_drake.dataset.labels import (
    SceneGrasps,
    grasps_of_run,
    label_grasps,
    label_instances,
    sampled_grasps,
)
from burg_drake.dataset.rendering import ImageKind, Images, SceneRenderer
from burg_drake.dataset.samples import Sample
from burg_drake.dataset.views import View, ViewSampler
from burg_drake.scene.document import Scene
from burg_drake.station.document import Station


class SceneSamples:
    """Makes the samples of one scene.

    Args:
        scene: the scene.
        number: of it in the data set.
        station: what it stands on.
        recipe: how samples are made.
        folder: of the data set, which the recipe's references start from.
        appearance: how it looks; drawn by the recipe if None.
        grasps: on its objects; those that the recipe asks for if None.
    """

    def __init__(
        self,
        scene: Scene,
        number: int,
        station: Station,
        recipe: DatasetRecipe,
        folder: Path,
        appearance: Appearance | None = None,
        grasps: SceneGrasps | None = None,
    ) -> None:
        self._scene, self._number, self._folder = scene, number, folder
        self._station, self._recipe, self._grasps = station, recipe, grasps
        looks = recipe.looks
        if appearance is None and looks is not None:
            rng = rng_from("dataset looks", recipe.seed, number)
            library = placed_library(looks.distractor_library, folder)
            settings = replace(looks, distractor_library=library)
            drawn = draw_appearance(settings, scene, station, rng)
            appearance = replace(drawn, library=looks.distractor_library)
        self._stored = appearance
        if appearance is not None:
            library = placed_library(appearance.library, folder)
            appearance = replace(appearance, library=library)
        self._appearance = appearance
        self._renderers: dict[tuple[bool, bool], SceneRenderer] = {}

    def __iter__(self) -> Iterator[Sample]:
        """The samples, as they are made.

        Raises:
            InvalidInputError: a view of the scene cannot be found.
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
        grasps = self._wanted_grasps() if self._grasps is None else self._grasps
        for number in range(recipe.views):
            view = views.sample(rng_from("dataset view", recipe.seed, self._number, number))
            yield self.sample(number, view, grasps)

    def sample(self, number: int, view: View, grasps: SceneGrasps | None = None) -> Sample:
        """The sample of a view.

        Args:
            number: of the view; noise follows from it.
            view: the camera.
            grasps: on the scene's objects.
        """
        recipe, renderer = self._recipe, self._renderer(view, self._recipe.colors)
        rng = rng_from("dataset image", recipe.seed, self._number, number)
        kinds: list[ImageKind] = ["depth", "labels"]
        if recipe.colors:
            kinds.append("color")
        if recipe.normals or recipe.sensor:
            kinds.append("normals")
        images = renderer.images(view, kinds, rng=rng)
        return Sample(
            scene=self._number,
            number=number,
            view=view,
            X_WS=self._station.document.X_WS.matrix(),
            images=images if recipe.normals else replace(images, normals=None),
            sensor_depth=self._measured(view, images, rng) if recipe.sensor else None,
            instances=label_instances(renderer, view, images),
            grasps=None if grasps is None else label_grasps(grasps, self._scene, view.X_SC),
            appearance={} if self._stored is None else self._stored.plain(),
        )

    def redrawn(self, view: View) -> Images:
        """Depth and labels of a view, for checks."""
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

    def _measured(self, view: View, images: Images, rng: np.random.Generator) -> np.ndarray:
        assert images.depth is not None
        return noisy_depth(
            images.depth,
            depth_noise(self._recipe.sensor),
            view.intrinsics,
            rng,
            normals=images.normals,
            color=images.color,
        )

    def _wanted_grasps(self) -> SceneGrasps | None:
        recipe = self._recipe
        if recipe.run:
            return grasps_of_run(run_folder(recipe, self._folder), self._scene)
        if recipe.grasps_per_object:
            return sampled_grasps(self._scene, self._station, recipe.grasps_per_object, recipe.seed)
        return None


def appearance_of(sample: Sample) -> Appearance | None:
    """How a sample looks, from what is stored with it.

    Raises:
        DocumentError: it does not fit.
    """
    if not sample.appearance:
        return None
    return read_appearance(sample.appearance, f"appearance of {sample.key}")
