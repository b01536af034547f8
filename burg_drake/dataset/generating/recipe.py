"""What decides about a data set, beside its scenes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from burg_drake.cameras.noise import depth_noise
from burg_drake.cameras.optics import sensor
from burg_drake.core import LARGEST_SEED, FieldError, InvalidInputError, nearest, setting
from burg_drake.core.documents import parse_document, plain_data, require_ranges
from burg_drake.dataset.appearance import AppearanceSettings
from burg_drake.dataset.blender import RENDERERS, RendererName
from burg_drake.dataset.views import ViewpointSettings
from burg_drake.scene.document import SceneRecipe
from burg_drake.station.document import MAX_SIDE

RANGES = {
    "seed": (0, LARGEST_SEED),
    "views": (1, 1000),
    "grasps_per_object": (0, 100_000),
}


@dataclass(frozen=True, kw_only=True)
class DatasetRecipe:
    """How samples are made of scenes. The sample of a scene's number and a view's follows from it,
    from the scene and from the station; it is the same alone and on any worker.

    Attributes:
        seed: all views and looks of another seed are others.
        views: of each scene.
        viewpoints: where they are drawn from.
        sensor: depth camera that all views are taken with, see `cameras.sensor`: its intrinsics,
            its range, and its noise as `sensor_depth`; cameras of the station, or like them,
            without noise, if empty.
        size: width and height of the sensor's images [pixels]; its usual ones if None.
        looks: how the looks of scenes vary, drawn once a scene; as simulated cameras always see
            them if None.
        colors: whether there are images of colours, which need a renderer. All other images are
            the same without them, but for `sensor_depth`, whose noise is drawn anew and has no
            holes at dark surfaces.
        renderer: of colours: `drake`, or `blender`, see `dataset.blender`; all else is the same.
        normals: whether there are images of normals.
        grasps_per_object: grasps that are sampled on each object and screened by the open hand.
        run: folder of a run whose grasps and outcomes are taken; none if empty.
        sampled: how scenes are sampled; None for given ones.
        given: content of each given scene, in their order.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True

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
        require_ranges(self, RANGES)
        if self.sensor:
            self._require_size()
            depth_noise(self.sensor)
        if self.renderer not in RENDERERS:
            raise FieldError(
                f"no renderer {self.renderer!r}; {nearest(self.renderer, RENDERERS)}", "renderer"
            )
        if self.run and self.grasps_per_object:
            raise FieldError("grasps are sampled or taken from a run, not both", "run")

    def _require_size(self) -> None:
        """Refuses images that the sensor does not have, or that are too large to be rendered."""
        try:
            camera = sensor(self.sensor).depth_camera(self.size)
        except InvalidInputError as error:
            raise FieldError(str(error), "size") from error
        if max(camera.width, camera.height) > MAX_SIDE:
            raise FieldError(
                f"images of {camera.width} x {camera.height} pixels; a side has at most"
                f" {MAX_SIDE:,}",
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
