"""What of each object is drawn on the sheet: bands of tint, outlines, and where it is cut off."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from burg_drake.core import Array
from burg_drake.core.terminal import Rgb
from burg_drake.printout.outlines import mask_outlines
from burg_drake.printout.projection import Grid, Layer, area_above, lowest_of
from burg_drake.printout.relief import instance_hue, projected_layers
from burg_drake.printout.tints import DARKEST, LIGHTEST, height_at, tint
from burg_drake.scene.document import IN_BOUNDS_TOLERANCE, Scene, placed_vertices

FINENESS = 0.1e-3
"""Side of the pixels that outlines are traced along [m]."""
BANDS = 20
"""Tints of an object, each 1.2 % of white from the next."""
BAND_SMOOTHING = 1.5
"""How far the edge between two tints may be off [px]; nobody sees it, and files are smaller."""
TOUCHING = 1e-3
"""What is lower than this stands on the sheet [m]; objects at rest sink in by tenths of it."""
OUTLINE_LUMA = 0.45
FOOTPRINT_LUMA = 0.30
"""Luma of the lines around an object and around where it touches the sheet."""
OUTLINE_DASHES = (0.0, 4e-3, 1.5e-3)
"""Lengths of the dashes of outlines in turn [m], which tell objects apart in a grey print."""
ON_BLACK_LUMA = 0.50
"""Luma of both on black cells."""
ARROW_INSET = 0.022
"""Distance of arrows to what is out of bounds from the board's edge [m], clear of what printers
leave white and of the rulers of a page of the board's size."""

Polygons = list[Array]


@dataclass(frozen=True, eq=False)
class Drawing:
    """An object on the sheet.

    Attributes:
        name: of the instance.
        words: what is written beside it.
        layer: what it covers.
        bands: colours and the areas that they fill, each over those before: from high to low.
        outline: around all of it, in `outline_color`.
        footprint: around where it touches the sheet, in `footprint_color`.
        on_black: colour of both lines on black cells.
        fixed: whether it belongs to the background.
        dash: length of the dashes of the outline [m]; 0 for a solid line.
        raised: around the part that lies above other objects, which covers none of the sheet.
    """

    name: str
    words: str
    layer: Layer
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
class Arrow:
    """Points to an object that reaches beyond the board.

    Attributes:
        name: of the instance.
        words: what is written beside it.
        start, tip: [m], on the board.
    """

    name: str
    words: str
    start: tuple[float, float]
    tip: tuple[float, float]


def draw_objects(scene: Scene) -> list[Drawing]:
    """The objects of a scene as they are drawn, free ones first; without those wholly beyond the
    board. Of what lies above other objects there is an outline alone."""
    layers = projected_layers(scene, Grid(scene.board.size, FINENESS))
    lowest = dict(zip(layers, lowest_of([*layers.values()]), strict=True))
    return [
        _drawing(scene, name, layers, lowest[name])
        for name, layer in layers.items()
        if layer.covered.any()
    ]


def _drawing(scene: Scene, name: str, layers: dict[str, Layer], lowest: Layer) -> Drawing:
    whole, number = layers[name], list(layers).index(name)
    hue, fixed = instance_hue(scene, name), name in scene.background
    lumas = DARKEST + (LIGHTEST - DARKEST) * (np.arange(BANDS) + 0.5) / BANDS
    tops = height_at(DARKEST + (LIGHTEST - DARKEST) * np.arange(1, BANDS) / BANDS)
    outline = mask_outlines(lowest, lowest.covered)
    bands = [(_rgb(hue, lumas[-1]), outline)]
    for k in range(BANDS - 1)[::-1]:
        area = mask_outlines(lowest, lowest.height < tops[k], BAND_SMOOTHING)
        if area:
            bands.append((_rgb(hue, lumas[k]), area))
    notes = ["fixed"] if fixed else []
    if whole.covered.sum() > 2 * lowest.covered.sum():
        notes.append(f"on {_supporter(name, layers)}")
    if whole.lowest > TOUCHING:
        notes.append(f"{1e3 * whole.lowest:.0f} mm up")
    return Drawing(
        name=name,
        words=name + (f" ({', '.join(notes)})" if notes else ""),
        layer=lowest if outline else whole,
        bands=tuple(bands),
        outline=outline,
        outline_color=_rgb(hue, OUTLINE_LUMA),
        footprint=mask_outlines(lowest, lowest.height < TOUCHING),
        footprint_color=_rgb(hue, FOOTPRINT_LUMA),
        on_black=_rgb(hue, ON_BLACK_LUMA),
        fixed=fixed,
        dash=OUTLINE_DASHES[number % len(OUTLINE_DASHES)],
        raised=mask_outlines(whole, whole.covered & ~lowest.covered),
    )


def _supporter(name: str, layers: dict[str, Layer]) -> str:
    """The object above which most of another lies."""
    others = [other for other in layers if other != name]
    return max(others, key=lambda other: area_above(layers[name], layers[other]))


def _rgb(hue: Rgb, luma: float) -> Rgb:
    r, g, b = tint(hue, luma).tolist()
    return r, g, b


def draw_arrows(scene: Scene) -> list[Arrow]:
    """Arrows to the free objects that reach beyond the board; fixed ones may stand anywhere."""
    size, arrows = np.array(scene.board.size), []
    for name in scene.instances:
        p_SV = placed_vertices(scene, name)[:, :2]
        lower, upper = p_SV.min(axis=0), p_SV.max(axis=0)
        beyond = np.array([-lower, upper - size])  # left and lower edge, right and upper edge
        side, axis = np.unravel_index(np.argmax(beyond), beyond.shape)
        if beyond[side, axis] <= IN_BOUNDS_TOLERANCE:
            continue
        inset = np.minimum(ARROW_INSET, size / 4)
        tip = np.clip((lower + upper) / 2, inset, size - inset)
        tip[axis] = (inset, size - inset)[side][axis]
        start = tip.copy()
        start[axis] += (1, -1)[side] * inset[axis] / 2
        far = beyond[side, axis]
        distance = f"{1e3 * far:.0f} mm" if far < 1.0 else f"{far:.3g} m"
        words = f"{name}: {distance} beyond the edge"
        arrows.append(Arrow(name, words, (start[0], start[1]), (tip[0], tip[1])))
    return arrows
