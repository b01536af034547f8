"""What decides about a data set, beside its scenes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from burg_drake.cameras.noise import depth_noise
from burg_drake.cameras.optics import sensor
from burg_drake.core import LARGEST_SEED, FieldError, InvalidInputError, nearest, setting
from burg_drake.core.documents import Ranges, parse_document, plain_data, require_ranges
from burg_drake.dataset.appearance import AppearanceSettings
from burg_drake.dataset.blender import RENDERERS, RendererName
from burg_drake.dataset.views import ViewpointSettings
from burg_drake.scene.document import SceneRecipe
from burg_drake.station.document import MAX_SIDE


@dataclass(frozen=True, kw_only=True)
class DatasetRecipe:
    """How a data set is made from scenes.

    Each sample follows from the numbers of its scene and view; it is the same on any number of
    workers.

    Attributes:
        seed: seed of all random choices; another one gives other views and looks.
        views: number of views of each scene.
        viewpoints: how views are drawn.
        sensor: depth camera that takes all views, with its intrinsics, depth range and noise;
            cameras of the station, without noise, if empty.
        size: width and height of the sensor's images [pixels]; its usual ones if left out.
        looks: how lights, colours and surroundings vary from scene to scene; always the same if
            null.
        colors: whether to write colour images, which need a renderer.
        renderer: renderer of colour images.
        normals: whether to write images of surface normals.
        grasps_per_object: number of grasps sampled on each object and checked for collisions of the
            open hand.
        run: folder of a run whose grasps and outcomes to use; none if empty.
        sampled: how scenes are sampled; null for scenes that are given.
        given: hashes of the given scenes, in their order.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True

    RANGES: ClassVar[Ranges] = {
        "seed": (0, LARGEST_SEED),
        "views": (1, 1000),
        "grasps_per_object": (0, 100_000),
    }

    version: int = 1
    seed: int = setting(0, "random seed", high=LARGEST_SEED)
    views: int = setting(20, "images of each scene and camera", metavar="K", low=1)
    viewpoints: ViewpointSettings = ViewpointSettings()
    sensor: str = setting(
        "",
        "depth camera to imitate: d435, d455, azure_kinect, zivid_two, kinect",
        metavar="NAME",
    )
    size: tuple[int, int] | None = None
    looks: AppearanceSettings | None = AppearanceSettings()
    colors: bool = setting(True, "do not write colour images", name="no_colors")
    renderer: RendererName = setting(
        "drake", "renderer of colour images; blender is photorealistic and slow", choices=RENDERERS
    )
    normals: bool = setting(False, "also write normals")
    grasps_per_object: int = 0
    run: str = ""
    sampled: SceneRecipe | None = None
    given: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        require_ranges(self)
        if self.sensor:
            self._require_size()
            depth_noise(self.sensor)
        if self.renderer not in RENDERERS:
            raise FieldError(
                f"renderer {self.renderer!r} does not exist; {nearest(self.renderer, RENDERERS)}",
                "renderer",
            )
        if self.run and self.grasps_per_object:
            raise FieldError(
                "grasps are either sampled or taken from a run; give only one of the two", "run"
            )

    def _require_size(self) -> None:
        """Refuses images that the sensor does not have, or that are too large to be rendered."""
        try:
            camera = sensor(self.sensor).depth_camera(self.size)
        except InvalidInputError as error:
            raise FieldError(str(error), "size") from error
        if max(camera.width, camera.height) > MAX_SIDE:
            raise FieldError(
                f"images of {camera.width} x {camera.height} pixels are too large; a side may have"
                f" at most {MAX_SIDE:,}",
                "size",
            )

    def plain(self) -> dict[str, Any]:
        """As dicts, lists, numbers and texts; `read_recipe` reads it."""
        found: dict[str, Any] = plain_data(self)
        return found


def read_recipe(data: Mapping[str, Any], name: str = "recipe") -> DatasetRecipe:
    """A recipe from plain data.

    Args:
        data: as `DatasetRecipe.plain` gives it.
        name: stands for the place that it is from in messages.

    Raises:
        DocumentError: it does not fit; the message names the key.
    """
    return parse_document(json.dumps(data), DatasetRecipe, name)
