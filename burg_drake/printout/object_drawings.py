"""Drawings of the objects on the sheet: height map, bands of tint, outlines and arrows."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import Array, InvalidInputError, Rgb, transform_points
from burg_drake.scene import IN_BOUNDS_TOLERANCE, Scene, SceneLike, as_scene, placed_vertices

BT601_LUMA_WEIGHTS = np.array([0.299, 0.587, 0.114])
"""Weights of red, green and blue (ITU-R BT.601)."""
MIN_LUMA = 0.70
"""Luma at the sheet; light enough for detectors beside black cells."""
MAX_LUMA = 0.94
"""Luma at the greatest height; paper has 1."""
MAX_TINT_HEIGHT = 0.10
"""Metres; above this height tints no longer change."""

TINT_COLORS = (
    (0.14, 0.49, 0.70),
    (0.50, 0.25, 0.00),
    (0.35, 0.70, 0.00),
    (0.85, 0.34, 0.47),
    (0.25, 0.17, 0.85),
    (0.44, 0.50, 0.00),
    (0.00, 0.85, 0.74),
    (0.32, 0.85, 0.00),
)
"""Hues of free objects, which differ by 11 in CIELAB, also with colour blindness."""
FIXED_TINT_COLOR = (0.35, 0.35, 0.35)
"""Hue of fixed objects."""


def luma_at(height: ArrayLike) -> Array:
    """Luma at heights [m] above the sheet. It is darkest and changes most at the sheet, so that
    small heights are easy to see."""
    share = np.clip(np.asarray(height, dtype=float) / MAX_TINT_HEIGHT, 0.0, 1.0)
    return MIN_LUMA + (MAX_LUMA - MIN_LUMA) * np.sqrt(share)


def height_at(luma: ArrayLike) -> Array:
    """Height [m] of a luma; the inverse of `luma_at`."""
    share = (np.asarray(luma, dtype=float) - MIN_LUMA) / (MAX_LUMA - MIN_LUMA)
    return MAX_TINT_HEIGHT * share**2


def tint_colors(hue: Rgb, luma: ArrayLike) -> Array:
    """(..., 3) colours of a hue, red, green, blue in [0, 1], with exactly these lumas (...).

    The hue is mixed with white to be brighter, and with black to be darker.
    """
    color, goal = np.asarray(hue), np.asarray(luma, dtype=float)[..., None]
    hue_luma = color @ BT601_LUMA_WEIGHTS
    lighter = 1.0 - (1.0 - color) * (1.0 - goal) / (1.0 - hue_luma)
    tinted: Array = np.where(goal >= hue_luma, lighter, color * goal / hue_luma)
    return tinted


@dataclass(frozen=True)
class SheetGrid:
    """Pixels of a sheet: row 0 lies along its upper edge, column 0 along its left one.

    Attributes:
        size: extents of the sheet along x and y [m].
        resolution: side of a pixel [m].
    """

    size: tuple[float, float]
    resolution: float

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and columns; the last ones may reach beyond the edge."""
        x, y = (int(np.ceil(s / self.resolution - 1e-6)) for s in self.size)
        return y, x

    def pixels(self, p_SQ: Array) -> Array:
        """(..., 2) column and row of points (..., 2 or 3) in the scene frame; pixel centres are at
        integers."""
        u = p_SQ[..., 0] / self.resolution - 0.5
        v = (self.size[1] - p_SQ[..., 1]) / self.resolution - 0.5
        return np.stack([u, v], axis=-1)

    def points(self, pixels: Array) -> Array:
        """(..., 2) points of the sheet [m] at (..., 2) columns and rows."""
        x = (pixels[..., 0] + 0.5) * self.resolution
        y = self.size[1] - (pixels[..., 1] + 0.5) * self.resolution
        return np.stack([x, y], axis=-1)


@dataclass(frozen=True, eq=False)
class SheetLayer:
    """Height map of one instance on a part of the grid.

    Attributes:
        grid: pixels of the whole sheet.
        row, column: position of the part's upper left pixel.
        height: (H, W) lowest point over each pixel's centre [m]; infinite beside the instance.
        lowest: lowest point of the instance [m].
    """

    grid: SheetGrid
    row: int
    column: int
    height: NDArray[np.float32]
    lowest: float

    @property
    def covered(self) -> NDArray[np.bool_]:
        """(H, W) mask of the pixels that the instance covers."""
        return np.isfinite(self.height)

    def points(self) -> Array:
        """(N, 2) centres of the covered pixels, in the scene frame [m]."""
        rows, columns = np.nonzero(self.covered)
        return self.grid.points(np.stack([columns + self.column, rows + self.row], axis=-1))

    @property
    def window(self) -> tuple[slice, slice]:
        """Slices of the part in the whole grid."""
        rows, columns = self.height.shape
        return slice(self.row, self.row + rows), slice(self.column, self.column + columns)


def lowest_surface(grid: SheetGrid, p_SV: Array, faces: NDArray[np.int64]) -> SheetLayer:
    """Projects the lowest parts of a surface onto the grid.

    Args:
        grid: grid of the sheet; parts beside it are left out.
        p_SV: (V, 3) vertices in the scene frame [m].
        faces: (F, 3) triangles of any winding.
    """
    uv = grid.pixels(p_SV)
    lower = np.clip(np.floor(uv.min(axis=0)), 0, None).astype(int)
    upper = np.minimum(np.ceil(uv.max(axis=0)), np.array(grid.shape[::-1]) - 1).astype(int)
    columns, rows = np.maximum(upper - lower + 1, 0)
    height = np.full(rows * columns, np.inf, dtype=np.float32)
    if height.size:
        corners = np.concatenate([uv - lower, p_SV[:, 2:]], axis=1)[faces]
        _paint_triangles(height, corners, (int(rows), int(columns)))
    lowest = float(p_SV[:, 2].min())
    return SheetLayer(grid, int(lower[1]), int(lower[0]), height.reshape(rows, columns), lowest)


def visible_layers(layers: list[SheetLayer]) -> list[SheetLayer]:
    """The layers, each without its parts above other layers."""
    shown = []
    for layer in layers:
        height = layer.height.copy()
        for other in layers:
            if other is not layer:
                mine, its = _shared_windows(layer, other)
                height[mine][other.height[its] < layer.height[mine]] = np.inf
        shown.append(dataclasses.replace(layer, height=height))
    return shown


def _shared_windows(
    layer: SheetLayer, other: SheetLayer
) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """The common part of two layers on the grid, as slices of the one and of the other."""
    top, left = max(layer.row, other.row), max(layer.column, other.column)
    bottom = max(top, min(layer.window[0].stop, other.window[0].stop))
    right = max(left, min(layer.window[1].stop, other.window[1].stop))

    def window(one: SheetLayer) -> tuple[slice, slice]:
        return (
            slice(top - one.row, bottom - one.row),
            slice(left - one.column, right - one.column),
        )

    return window(layer), window(other)


def _paint_triangles(height: NDArray[np.float32], corners: Array, shape: tuple[int, int]) -> None:
    """Lowers a flattened `height` to the triangles, row by row.

    Args:
        height: (rows * columns,) changed in place.
        corners: (F, 3, 3) column, row, height [m] of each corner.
        shape: rows and columns.
    """
    chunk_size = 2_000_000  # Pixels painted at a time, to bound the memory.
    tolerance = 1e-7  # Pixels; centres this close to an edge lie inside, so no gap remains.
    triangle, row, left, right = _row_spans(corners, shape)
    first = np.clip(np.ceil(left - tolerance), 0, None).astype(np.int64)
    last = np.minimum(np.floor(right + tolerance), shape[1] - 1).astype(np.int64)
    slopes = _triangle_slopes(corners)
    lowest, highest = corners[:, :, 2].min(axis=1), corners[:, :, 2].max(axis=1)
    count = np.maximum(last - first + 1, 0)
    chunk = (np.cumsum(count) - 1) // chunk_size
    for k in range(int(chunk[-1]) + 1 if len(chunk) else 0):
        part = (chunk == k) & (count > 0)
        n = count[part]
        t, r = np.repeat(triangle[part], n), np.repeat(row[part], n)
        c = np.arange(n.sum()) + np.repeat(first[part] - (np.cumsum(n) - n), n)
        z = corners[t, 0, 2]
        z += slopes[t, 0] * (c - corners[t, 0, 0]) + slopes[t, 1] * (r - corners[t, 0, 1])
        z = np.clip(z, lowest[t], highest[t]).astype(np.float32)
        np.minimum.at(height, r * shape[1] + c, z)


def _row_spans(
    corners: Array, shape: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, Array]:
    """Triangle, row, left and right end [px] of each pixel row of each triangle."""
    v = corners[:, :, 1]
    top = np.clip(np.ceil(v.min(axis=1)), 0, None).astype(np.int64)
    bottom = np.minimum(np.floor(v.max(axis=1)), shape[0] - 1).astype(np.int64)
    n = np.maximum(bottom - top + 1, 0)
    triangle = np.repeat(np.arange(len(corners)), n)
    row = np.arange(n.sum()) + np.repeat(top - (np.cumsum(n) - n), n)
    left, right = np.full(len(row), np.inf), np.full(len(row), -np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        a, b = corners[triangle, i], corners[triangle, j]
        rise = b[:, 1] - a[:, 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (row - a[:, 1]) / rise
        # Never at a level edge, whose ends belong to other edges, too.
        crossed = (share >= 0.0) & (share <= 1.0)
        u = a[:, 0] + np.where(crossed, share, 0.0) * (b[:, 0] - a[:, 0])
        left = np.where(crossed, np.minimum(left, u), left)
        right = np.where(crossed, np.maximum(right, u), right)
    hit = left <= right
    return triangle[hit], row[hit], left[hit], right[hit]


def _triangle_slopes(corners: Array) -> Array:
    """(F, 2) rise of each triangle's plane per column and row [m]; 0 for vertical triangles."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(a, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = -normal[:, :2] / normal[:, 2:]
    return np.where(np.isfinite(slopes), slopes, 0.0)


@dataclass(frozen=True, eq=False)
class HeightMap:
    """Pixels of a board; row 0 lies along its upper edge, column 0 along its left one.

    Attributes:
        image: (H, W, 3) printed colours, red, green, blue; white beside the objects.
        height: (H, W) lowest point of any object over each pixel's centre [m]; NaN without one.
        instance: (H, W) index into `names` of the instance with that point; -1 without one.
        names: names of the instances, free ones first.
        resolution: side of a pixel [m]; pixel (r, c) has its centre at x = (c + 0.5) resolution,
            y = size_y - (r + 0.5) resolution in the scene frame.
    """

    image: NDArray[np.uint8]
    height: NDArray[np.float32]
    instance: NDArray[np.int16]
    names: tuple[str, ...]
    resolution: float


def height_map(scene: SceneLike, resolution: float = 0.5e-3) -> HeightMap:
    """The height map of a scene, without markers.

    Args:
        scene: scene; its free and fixed objects are shown as far as they are over the board.
        resolution: side of a pixel [m].

    Raises:
        InvalidInputError: the resolution gives no image, or too large an image.
        UnknownNameError: a mesh file is missing.
    """
    max_pixels = 400_000_000  # 4 GB of memory.
    scene = as_scene(scene)
    size = scene.board.size
    if not resolution > 0.0 or size[0] * size[1] / resolution**2 > max_pixels:
        raise InvalidInputError(
            f"a resolution of {resolution:g} m per pixel does not suit a board of"
            f" {1e3 * size[0]:g} x {1e3 * size[1]:g} mm; it must be above 0 and give at most"
            f" {max_pixels:.0e} pixels"
        )
    grid = SheetGrid(size, resolution)
    layers = projected_layers(scene, grid)
    height = np.full(grid.shape, np.nan, dtype=np.float32)
    instance = np.full(grid.shape, -1, dtype=np.int16)
    image = np.full((*grid.shape, 3), 255, dtype=np.uint8)
    for k, (name, layer) in enumerate(zip(layers, visible_layers([*layers.values()]), strict=True)):
        seen = layer.covered
        height[layer.window][seen] = layer.height[seen]
        instance[layer.window][seen] = k
        colors = tint_colors(instance_hue(scene, name), luma_at(layer.height[seen]))
        image[layer.window][seen] = np.round(255 * colors)
    return HeightMap(image, height, instance, tuple(layers), resolution)


def projected_layers(scene: Scene, grid: SheetGrid) -> dict[str, SheetLayer]:
    """The lowest surface of each instance over the sheet, by name, free ones first."""
    layers = {}
    for name in (*scene.instances, *scene.background):
        surface = scene.library.surface(scene.instance(name).object)
        p_SV = transform_points(scene.X_SO(name), surface.vertices)
        layers[name] = lowest_surface(grid, p_SV, surface.faces)
    return layers


def instance_hue(scene: Scene, name: str) -> Rgb:
    """Hue of an instance; all fixed instances share one hue."""
    free = list(scene.instances)
    return (
        TINT_COLORS[free.index(name) % len(TINT_COLORS)]
        if name in scene.instances
        else FIXED_TINT_COLOR
    )


def mask_outlines(
    layer: SheetLayer, mask: NDArray[np.bool_], smoothing: float = 0.6
) -> list[Array]:
    """Outlines of a mask.

    Args:
        layer: layer with the mask's position on the grid.
        mask: (H, W) mask of the layer's pixels.
        smoothing: largest distance of an outline from the pixels along which it runs [px].

    Returns:
        Closed polygons (N, 2) [m], outer ones and, in the opposite direction, holes. They run
        through the centres of the mask's outermost pixels.
    """
    min_area = 0.5e-6  # Square metres; smaller areas of a mask are left out.
    curves, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    grid = layer.grid
    offset = np.array([layer.column, layer.row])
    min_pixels = min_area / grid.resolution**2
    kept = [c for c in curves if cv2.contourArea(c) >= min_pixels]
    simple = [cv2.approxPolyDP(c, smoothing, True)[:, 0] for c in kept]
    return [grid.points(c + offset) for c in simple if len(c) > 2]


def cell_outlines(black: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Outlines of the black cells of a marker, with neighbouring cells joined: cells filled one by
    one would show white hairlines between them.

    Args:
        black: (K, K) mask of the black cells, rows from the top.

    Returns:
        Closed polygons (N, 2) of columns and rows of corners of cells, with black to the right as
        seen in the image: outer ones clockwise, holes the other way round.
    """
    padded = np.pad(black, 1)
    after: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for row, column in np.argwhere(black).tolist():
        r, c = row + 1, column + 1
        sides = (
            (padded[r - 1, c], (column, row), (column + 1, row)),
            (padded[r, c + 1], (column + 1, row), (column + 1, row + 1)),
            (padded[r + 1, c], (column + 1, row + 1), (column, row + 1)),
            (padded[r, c - 1], (column, row + 1), (column, row)),
        )
        for neighbour, start, end in sides:
            if not neighbour:
                after.setdefault(start, []).append(end)
    loops = []
    while after:
        loop = [next(iter(after))]
        while loop[-1] in after:
            ends = after[loop[-1]]
            point = ends.pop()
            if not ends:
                del after[loop[-1]]
            loop.append(point)
        loops.append(_polygon_corners(np.array(loop[:-1])))
    return loops


def _polygon_corners(loop: NDArray[np.int64]) -> NDArray[np.int64]:
    """Corners of a closed polygon of unit steps."""
    turned = (np.roll(loop, 1, axis=0) - 2 * loop + np.roll(loop, -1, axis=0)).any(axis=1)
    return loop[turned]


OUTLINE_RESOLUTION = 0.1e-3
"""Metres, side of the pixels along which outlines are traced."""

Polygons = list[Array]


@dataclass(frozen=True, eq=False)
class ObjectDrawing:
    """An object on the sheet.

    Attributes:
        name: name of the instance.
        words: text beside it.
        layer: height map of the instance.
        bands: colours and the areas that they fill, from high to low, each over the previous ones.
        outline: outlines of the object, drawn in `outline_color`.
        footprint: outlines of the area that touches the sheet, drawn in `footprint_color`.
        on_black: colour of both lines on black cells.
        fixed: whether it belongs to the background.
        dash: length of the dashes of the outline [m]; 0 for a solid line.
        raised: outlines of the part above other objects, which covers none of the sheet.
    """

    name: str
    words: str
    layer: SheetLayer
    bands: tuple[tuple[Rgb, Polygons], ...]
    outline: Polygons
    outline_color: Rgb
    footprint: Polygons
    footprint_color: Rgb
    on_black: Rgb
    fixed: bool
    dash: float = 0.0
    raised: Polygons = field(default_factory=list)


@dataclass(frozen=True)
class OutOfBoundsArrow:
    """An arrow to an object that reaches beyond the board.

    Attributes:
        name: name of the instance.
        words: text beside it.
        start, tip: ends of the arrow on the board [m].
    """

    name: str
    words: str
    start: tuple[float, float]
    tip: tuple[float, float]


def draw_objects(scene: Scene) -> list[ObjectDrawing]:
    """Drawings of a scene's objects, free ones first, without those wholly beyond the board. Parts
    above other objects have only an outline."""
    layers = projected_layers(scene, SheetGrid(scene.board.size, OUTLINE_RESOLUTION))
    lowest = dict(zip(layers, visible_layers([*layers.values()]), strict=True))
    return [
        _draw_object(scene, name, layers, lowest[name])
        for name, layer in layers.items()
        if layer.covered.any()
    ]


def _draw_object(
    scene: Scene, name: str, layers: dict[str, SheetLayer], lowest: SheetLayer
) -> ObjectDrawing:
    band_count = 20  # Tints of an object, 1.2 % of white apart.
    band_smoothing = 1.5  # Pixels; coarser edges between tints make smaller files.
    touch_height = 1e-3  # Metres above the sheet; objects at rest sink by tenths of it.
    outline_luma = 0.45  # Luma of the line around the object.
    footprint_luma = 0.30  # Luma of the line around the area that touches the sheet.
    dashes = (0.0, 4e-3, 1.5e-3)  # Metres; they tell objects apart in a grey print.
    on_black_luma = 0.50  # Luma of both lines on black cells.
    whole, number = layers[name], list(layers).index(name)
    hue, fixed = instance_hue(scene, name), name in scene.background
    lumas = MIN_LUMA + (MAX_LUMA - MIN_LUMA) * (np.arange(band_count) + 0.5) / band_count
    tops = height_at(MIN_LUMA + (MAX_LUMA - MIN_LUMA) * np.arange(1, band_count) / band_count)
    outline = mask_outlines(lowest, lowest.covered)
    bands = [(_tint_rgb(hue, lumas[-1]), outline)]
    for k in range(band_count - 1)[::-1]:
        area = mask_outlines(lowest, lowest.height < tops[k], band_smoothing)
        if area:
            bands.append((_tint_rgb(hue, lumas[k]), area))
    notes = ["fixed"] if fixed else []
    if whole.covered.sum() > 2 * lowest.covered.sum():
        notes.append(f"on {_supporting_object(name, layers)}")
    if whole.lowest > touch_height:
        notes.append(f"{1e3 * whole.lowest:.0f} mm up")
    return ObjectDrawing(
        name=name,
        words=name + (f" ({', '.join(notes)})" if notes else ""),
        layer=lowest if outline else whole,
        bands=tuple(bands),
        outline=outline,
        outline_color=_tint_rgb(hue, outline_luma),
        footprint=mask_outlines(lowest, lowest.height < touch_height),
        footprint_color=_tint_rgb(hue, footprint_luma),
        on_black=_tint_rgb(hue, on_black_luma),
        fixed=fixed,
        dash=dashes[number % len(dashes)],
        raised=mask_outlines(whole, whole.covered & ~lowest.covered),
    )


def _supporting_object(name: str, layers: dict[str, SheetLayer]) -> str:
    """Name of the object above which most of an object lies."""

    def pixels_below(other: str) -> int:
        mine, its = _shared_windows(layers[name], layers[other])
        return int((layers[other].height[its] < layers[name].height[mine]).sum())

    return max((other for other in layers if other != name), key=pixels_below)


def _tint_rgb(hue: Rgb, luma: float) -> Rgb:
    r, g, b = tint_colors(hue, luma).tolist()
    return r, g, b


def draw_arrows(scene: Scene) -> list[OutOfBoundsArrow]:
    """Arrows to the free objects that reach beyond the board; fixed objects may stand anywhere."""
    arrow_inset = 0.022  # Metres from the board's edge, clear of margins and rulers.
    size, arrows = np.array(scene.board.size), []
    for name in scene.instances:
        p_SV = placed_vertices(scene, name)[:, :2]
        lower, upper = p_SV.min(axis=0), p_SV.max(axis=0)
        beyond = np.array([-lower, upper - size])  # left and lower edge, right and upper edge
        side, axis = np.unravel_index(np.argmax(beyond), beyond.shape)
        if beyond[side, axis] <= IN_BOUNDS_TOLERANCE:
            continue
        inset = np.minimum(arrow_inset, size / 4)
        tip = np.clip((lower + upper) / 2, inset, size - inset)
        tip[axis] = (inset, size - inset)[side][axis]
        start = tip.copy()
        start[axis] += (1, -1)[side] * inset[axis] / 2
        far = beyond[side, axis]
        distance = f"{1e3 * far:.0f} mm" if far < 1.0 else f"{far:.3g} m"
        words = f"{name}: {distance} beyond the edge"
        arrows.append(OutOfBoundsArrow(name, words, (start[0], start[1]), (tip[0], tip[1])))
    return arrows
