"""The height map of a scene: what its objects look like from the sheet that they stand on.

The lowest surface over each point of the sheet, as in the paper on BURG (Rudorfer et al., 2022)
where triangles are painted from high to low: lower parts stay visible below higher ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import InvalidInputError, transform_points
from burg_drake.core.terminal import Rgb
from burg_drake.printout.projection import Grid, Layer, lowest_of, lowest_surface
from burg_drake.printout.tints import FIXED_HUE, hue, luma_at, tint
from burg_drake.scene.document import Scene, SceneLike, as_scene

RESOLUTION = 0.5e-3
"""Side of a pixel of a height map, if not told otherwise [m]."""
MAX_PIXELS = 400_000_000
"""Of a height map: 4 GB in memory."""


@dataclass(frozen=True, eq=False)
class HeightMap:
    """Pixels of a board; row 0 lies along its upper edge, column 0 along its left one.

    Attributes:
        image: (H, W, 3) colours as they are printed, red, green, blue; white where nothing is.
        height: (H, W) lowest point of any object over each pixel's centre [m]; NaN where there is
            none.
        instance: (H, W) index into `names` of the instance that it belongs to; -1 where there is
            none.
        names: of the instances, free ones first.
        resolution: side of a pixel [m]; pixel (r, c) has its centre at x = (c + 0.5) resolution,
            y = size_y - (r + 0.5) resolution in the scene frame.
    """

    image: NDArray[np.uint8]
    height: NDArray[np.float32]
    instance: NDArray[np.int16]
    names: tuple[str, ...]
    resolution: float


def height_map(scene: SceneLike, resolution: float = RESOLUTION) -> HeightMap:
    """The height map of a scene, without markers.

    Args:
        scene: free and fixed objects; of those that reach beyond the board, what is over it.
        resolution: side of a pixel [m].

    Raises:
        InvalidInputError: the resolution makes no image, or too large a one.
        UnknownNameError: a mesh file is missing.
    """
    scene = as_scene(scene)
    size = scene.board.size
    if not resolution > 0.0 or size[0] * size[1] / resolution**2 > MAX_PIXELS:
        raise InvalidInputError(
            f"a resolution of {resolution:g} m per pixel does not suit a board of"
            f" {1e3 * size[0]:g} x {1e3 * size[1]:g} mm; it must be above 0 and give at most"
            f" {MAX_PIXELS:.0e} pixels"
        )
    grid = Grid(size, resolution)
    layers = projected_layers(scene, grid)
    height = np.full(grid.shape, np.nan, dtype=np.float32)
    instance = np.full(grid.shape, -1, dtype=np.int16)
    image = np.full((*grid.shape, 3), 255, dtype=np.uint8)
    for k, (name, layer) in enumerate(zip(layers, lowest_of([*layers.values()]), strict=True)):
        seen = layer.covered
        height[layer.window][seen] = layer.height[seen]
        instance[layer.window][seen] = k
        colors = tint(instance_hue(scene, name), luma_at(layer.height[seen]))
        image[layer.window][seen] = np.round(255 * colors)
    return HeightMap(image, height, instance, tuple(layers), resolution)


def projected_layers(scene: Scene, grid: Grid) -> dict[str, Layer]:
    """The lowest surface of each instance over the sheet, by name, free ones first."""
    layers = {}
    for name in (*scene.instances, *scene.background):
        surface = scene.library.surface(scene.instance(name).object)
        p_SV = transform_points(scene.X_SO(name), surface.vertices)
        layers[name] = lowest_surface(grid, p_SV, surface.faces)
    return layers


def instance_hue(scene: Scene, name: str) -> Rgb:
    """Hue of an instance; all fixed ones share one."""
    free = list(scene.instances)
    return hue(free.index(name)) if name in scene.instances else FIXED_HUE
