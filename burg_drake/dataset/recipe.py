"""The recipe of a data set, and the libraries, station and run that it refers to."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

from burg_drake.cameras import depth_noise, sensor
from burg_drake.core import (
    MAX_DOCUMENT_SEED,
    PACKAGE_URI,
    FieldError,
    InvalidInputError,
    Ranges,
    builtin_names,
    content_hash,
    plain_data,
    portable_reference,
    read_plain_data,
    require_ranges,
    resolve_reference,
    setting,
    suggest_names,
)
from burg_drake.dataset.appearance import AppearanceSettings
from burg_drake.dataset.blender_process import RENDERERS, RendererName
from burg_drake.dataset.document import DatasetDocument
from burg_drake.dataset.views import ViewpointSettings
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.scene import SceneRecipe
from burg_drake.station import MAX_IMAGE_SIDE, Station, load_station


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
        "seed": (0, MAX_DOCUMENT_SEED),
        "views": (1, 1000),
        "grasps_per_object": (0, 100_000),
    }

    version: int = 1
    seed: int = setting(0, "random seed", high=MAX_DOCUMENT_SEED)
    views: int = setting(20, "images of each scene and camera", metavar="K", low=1)
    viewpoints: ViewpointSettings = ViewpointSettings()
    sensor: str = setting(
        "", "depth camera to imitate: d435, d455, azure_kinect, zivid_two, kinect", metavar="NAME"
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
                f"renderer {self.renderer!r} does not exist;"
                f" {suggest_names(self.renderer, RENDERERS)}",
                "renderer",
            )
        if self.run and self.grasps_per_object:
            raise FieldError(
                "grasps are either sampled or taken from a run; give only one of the two", "run"
            )

    def _require_size(self) -> None:
        """Refuses image sizes that the sensor does not have, or that are too large to render."""
        try:
            camera = sensor(self.sensor).depth_camera(self.size)
        except InvalidInputError as error:
            raise FieldError(str(error), "size") from error
        if max(camera.width, camera.height) > MAX_IMAGE_SIDE:
            raise FieldError(
                f"images of {camera.width} x {camera.height} pixels are too large; a side may have"
                f" at most {MAX_IMAGE_SIDE:,}",
                "size",
            )

    def plain(self) -> dict[str, Any]:
        """The recipe as dicts, lists, numbers and strings, for `read_recipe`."""
        found: dict[str, Any] = plain_data(self)
        return found


def read_recipe(data: Mapping[str, Any], name: str = "recipe") -> DatasetRecipe:
    """Reads a recipe from plain data.

    Args:
        data: data that `DatasetRecipe.plain` returned.
        name: source of the data, for messages.

    Raises:
        DocumentError: the data are invalid; the message names the key.
    """
    return read_plain_data(data, DatasetRecipe, name)


CONTENT_DIGITS = 16  # Digits of the content hashes in `dataset.yaml`.


def library_content(library: ObjectLibrary) -> str:
    """Hash of a library's content."""
    return content_hash(library.content)[:CONTENT_DIGITS]


def portable_recipe(recipe: DatasetRecipe, folder: Path) -> DatasetRecipe:
    """A recipe whose paths, of the distractor library and the run, are relative to the folder of
    the data set instead of the working directory.

    Args:
        recipe: recipe with a built-in name, or paths relative to the working directory.
        folder: folder of the data set.

    Raises:
        UnknownNameError: there is no such library.
    """
    run = portable_reference(Path(recipe.run), folder) if recipe.run else ""
    if recipe.looks is None:
        return replace(recipe, run=run)
    root = load_library(recipe.looks.distractor_library).root
    looks = replace(recipe.looks, distractor_library=portable_reference(root, folder))
    return replace(recipe, run=run, looks=looks)


def resolve_library_path(reference: str, folder: Path) -> str:
    """Path or built-in name of a library that a data set refers to.

    Raises:
        UnknownNameError: the library does not exist.
    """
    if reference.startswith(PACKAGE_URI) or reference in builtin_names("models"):
        return str(resolve_reference(reference, "models"))
    return str(resolve_reference(_resolve_from(folder, reference)))


def run_folder(recipe: DatasetRecipe, folder: Path) -> Path:
    """Folder of the run that provides a data set's grasps."""
    return _resolve_from(folder, recipe.run)


def _resolve_from(folder: Path, reference: str) -> Path:
    """A path relative to the folder of a data set, which need not exist yet."""
    return Path(os.path.normpath(folder.absolute() / reference))


def distractors_content(recipe: DatasetRecipe, folder: Path) -> str:
    """Hash of the distractor library's content; empty without distractors."""
    if recipe.looks is None or not recipe.looks.distractors[1]:
        return ""
    root = resolve_library_path(recipe.looks.distractor_library, folder)
    return library_content(load_library(root))


def require_same_contents(
    document: DatasetDocument, recipe: DatasetRecipe, folder: Path
) -> Station:
    """Loads the station of a data set. It and the libraries must not have changed.

    Raises:
        InvalidInputError: the station or a library has changed; the message names it.
        UnknownNameError: the station or a library does not exist any more.
    """
    library = load_library(resolve_reference(document.library, "models", folder))
    station = load_station(resolve_reference(document.station, "stations", folder))
    for what, then, now in (
        (f"library {library.root}", document.library_content, library_content(library)),
        (f"station {station.path}", document.station_content, station.content[:CONTENT_DIGITS]),
        (
            "the library of distractors",
            document.distractors_content,
            distractors_content(recipe, folder),
        ),
    ):
        if then != now:
            raise InvalidInputError(
                f"{what} has changed since the data set {folder} was made, so its images cannot be"
                " rendered again"
            )
    return station
