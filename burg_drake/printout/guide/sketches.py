"""Small pictures of how a board is printed, assembled and used; lines and areas, no photographs.

Each is drawn in a box of `BOX`, from its lower left corner, in metres of the page before it is
scaled. What is right has a green tick, what is wrong a red cross.
"""

from __future__ import annotations

import math

import numpy as np

from burg_drake.core import Array
from burg_drake.core.terminal import Rgb
from burg_drake.printout.drawings import Drawing
from burg_drake.printout.pen import BOLD, FAINT, INK, WHITE, Pen, rectangle
from burg_drake.printout.tiling import Tiling

BOX = (0.080, 0.0255)
"""Width and height of a sketch [m]."""
PLAN_HEIGHT = 0.042
"""Height of the plan of pages [m]."""
GOOD: Rgb = (0.0, 0.50, 0.30)
BAD: Rgb = (0.75, 0.12, 0.10)
PAPER: Rgb = (0.95, 0.96, 0.97)
SOFT: Rgb = (0.80, 0.83, 0.87)
FIT: Rgb = (0.86, 0.94, 0.89)
GLOW: Rgb = (0.98, 0.80, 0.30)
LABEL = 10.0
"""Of words in sketches [points]."""
THICK = 0.5e-3

Spot = tuple[float, float]


def draw_scale(pen: Pen) -> None:
    """The board at its true size, and one that was fitted to the page."""
    for x, share, words, good in ((4e-3, 1.0, "100 %", True), (44e-3, 0.7, "fit to page", False)):
        _sheet(pen, (x, 3e-3), (x + 16e-3, 25e-3))
        middle = np.array([x + 8e-3, 14e-3])
        for column in (-1, 0, 1):
            for row in (-1, 0, 1):
                at = middle + share * 5.2e-3 * np.array([column, row])
                half = share * 1.9e-3
                pen.area([rectangle(at - half, at + half)], INK)
        _verdict(pen, (x + 18.5e-3, 15e-3), good=good)
        pen.text(x + 17.5e-3, 7e-3, words, LABEL, font=BOLD, color=GOOD if good else BAD)


def draw_measuring(pen: Pen) -> None:
    """A ruler of steel held to the printed one."""
    left, right, line = 5e-3, 65e-3, 8e-3
    pen.area([rectangle((left - 3e-3, line + 0.6e-3), (right + 9e-3, line + 9e-3))], SOFT)
    pen.outline([rectangle((left - 3e-3, line + 0.6e-3), (right + 9e-3, line + 9e-3))], 0.2e-3, INK)
    pen.line((left, line), (right, line), width=0.3e-3)
    for k in range(11):
        x = left + (right - left) * k / 10
        long = k % 5 == 0
        pen.line((x, line), (x, line - (2.6e-3 if long else 1.5e-3)), width=0.3e-3)
        pen.line((x, line + 0.6e-3), (x, line + (3.2e-3 if long else 2.2e-3)), width=0.2e-3)
    for x, words in ((left, "0"), (right, "100 mm")):
        pen.text(x, line - 6.6e-3, words, LABEL, align=0.5)
        pen.text(x, line + 4.4e-3, words[:3].strip(), LABEL, align=0.5)
    pen.text(left, line + 11.5e-3, "both printed rulers: 100 mm each", LABEL, font=BOLD)
    _verdict(pen, (right + 6e-3, line + 13e-3), good=True)


def draw_cutting(pen: Pen) -> None:
    """A page whose left and upper rims are cut off."""
    low, high = np.array([22e-3, 2e-3]), np.array([60e-3, 25e-3])
    cut = np.array([low[0] + 6e-3, high[1] - 6e-3])
    pen.area([rectangle(low, high), rectangle((cut[0], low[1]), (high[0], cut[1]))], SOFT)
    pen.outline([rectangle(low, high)], 0.2e-3, INK)
    pen.line((cut[0], low[1]), (cut[0], high[1]), width=THICK, color=BAD, dash=1.5e-3)
    pen.line((low[0], cut[1]), (high[0], cut[1]), width=THICK, color=BAD, dash=1.5e-3)
    for x, y in ((high[0] - 5e-3, low[1]), (cut[0], low[1] + 5e-3)):
        end = (x, high[1]) if y == low[1] else (high[0], y)
        if y == low[1]:
            pen.line((x, low[1]), (x, cut[1]), width=0.2e-3, color=FAINT, dash=1.2e-3)
        else:
            pen.line((cut[0], y), (end[0], y), width=0.2e-3, color=FAINT, dash=1.2e-3)
    _scissors(pen, (float(high[0]) + 1.5e-3, float(cut[1])))
    pen.text(float(cut[0]) + 7e-3, float(cut[1]) + 1.6e-3, "CUT", LABEL, font=BOLD, color=BAD)
    pen.text(float(cut[0]) + 7e-3, float(cut[1]) - 8.5e-3, "stays", LABEL)


def draw_gluing(pen: Pen, flap: float) -> None:
    """A page that is laid onto the strip of the one before it.

    Args:
        pen: draws in the box.
        flap: width of the strips [m]; 0 if pages are joined edge to edge.
    """
    _sheet(pen, (8e-3, 4e-3), (38e-3, 23e-3))
    seam = 31e-3 if flap else 38e-3
    if flap:
        for y in np.arange(5e-3, 22.9e-3, 2e-3).tolist():
            pen.line((seam + 0.5e-3, y), (37.5e-3, y + 0.8e-3), width=0.25e-3, color=GOOD)
    start = seam + 8e-3
    _sheet(pen, (start, 6e-3), (start + 30e-3, 25e-3))
    for x, y in ((seam, 13.5e-3), (start, 15.5e-3)):
        pen.circle(x, y, 1.8e-3, INK, 0.25e-3)
        pen.line((x - 2.8e-3, y), (x + 2.8e-3, y), width=0.25e-3)
        pen.line((x, y - 2.8e-3), (x, y + 2.8e-3), width=0.25e-3)
    _arrow(pen, (start - 1.5e-3, 9.0e-3), (seam + 0.8e-3, 7.0e-3), INK)
    pen.text(19e-3, 12e-3, "1", 16, font=BOLD, align=0.5)
    pen.text(start + 17e-3, 14e-3, "2", 16, font=BOLD, align=0.5)
    pen.text(8e-3, 0.2e-3, "glue on the strip" if flap else "edge to edge", LABEL)


def draw_plan(pen: Pen, tiling: Tiling, size: tuple[float, float], objects: list[Drawing]) -> None:
    """The whole board: its pages with their numbers, cuts, and the outlines of its objects."""
    scale = min(BOX[0] / size[0], PLAN_HEIGHT / size[1])
    shift = np.array([(BOX[0] - scale * size[0]) / 2, 0.0])
    xs = [0.0, *tiling.x_cuts, size[0]]
    ys = [size[1], *tiling.y_cuts, 0.0]
    for tile in tiling.tiles:
        lower = shift + scale * np.array([xs[tile.column], ys[tile.row + 1]])
        upper = shift + scale * np.array([xs[tile.column + 1], ys[tile.row]])
        shade = PAPER if (tile.row + tile.column) % 2 else WHITE
        pen.area([rectangle(lower, upper)], shade)
        pen.outline([rectangle(lower, upper)], 0.25e-3, INK)
    for drawing in objects:
        loops = [shift + scale * loop for loop in (*drawing.outline, *drawing.raised)]
        pen.outline(loops, 0.3e-3, drawing.outline_color)
    for tile in tiling.tiles:
        (left, right), (top, bottom) = xs[tile.column :][:2], ys[tile.row :][:2]
        middle, height = ((left + right) / 2, (top + bottom) / 2), scale * (top - bottom)
        points = min(18.0, 0.5 * height / 0.35e-3)
        at = shift + scale * np.array(middle) - [0.0, 0.12e-3 * points]
        pen.text(float(at[0]), float(at[1]), str(tile.number), points, font=BOLD, align=0.5)


def draw_flatness(pen: Pen) -> None:
    """A sheet on a stiff plate, and one that waves."""
    pen.area([rectangle((2e-3, 8e-3), (36e-3, 12e-3))], SOFT)
    pen.outline([rectangle((2e-3, 8e-3), (36e-3, 12e-3))], 0.2e-3, INK)
    pen.line((2e-3, 12.5e-3), (36e-3, 12.5e-3), width=0.8e-3)
    pen.text(19e-3, 2.5e-3, "glued to a plate", LABEL, align=0.5)
    _verdict(pen, (17e-3, 17e-3), good=True)
    x = np.linspace(44e-3, 78e-3, 60)
    y = 11e-3 + 2.0e-3 * np.sin((x - 44e-3) / 34e-3 * 4 * np.pi)
    pen.line((44e-3, 8e-3), (78e-3, 8e-3), width=0.3e-3, color=FAINT)
    pen.line(*zip(x.tolist(), y.tolist(), strict=True), width=0.8e-3)
    pen.text(61e-3, 2.5e-3, "waves, curls", LABEL, align=0.5)
    _verdict(pen, (59e-3, 17e-3), good=False)


def draw_light(pen: Pen) -> None:
    """Soft light from a wide source, and a lamp with its shadow and its glare."""
    for left in (2e-3, 44e-3):
        pen.line((left, 6e-3), (left + 34e-3, 6e-3), width=0.6e-3)
        pen.area([rectangle((left + 14e-3, 6.3e-3), (left + 20e-3, 12e-3))], SOFT)
        pen.outline([rectangle((left + 14e-3, 6.3e-3), (left + 20e-3, 12e-3))], 0.25e-3, INK)
    pen.area([rectangle((6e-3, 23.5e-3), (32e-3, 25.5e-3))], GLOW)
    for x in (8e-3, 15e-3, 22e-3, 29e-3):
        _arrow(pen, (x, 22.5e-3), (x, 16e-3), FAINT)
    pen.text(19e-3, 0.5e-3, "wide, soft light", LABEL, align=0.5)
    _verdict(pen, (34.5e-3, 20e-3), good=True)
    lamp = 48e-3, 22e-3
    pen.area([_disc(lamp, 2.2e-3)], GLOW)
    _arrow(pen, (50e-3, 20.5e-3), (57e-3, 13.5e-3), FAINT)
    pen.area([rectangle((64e-3, 5.2e-3), (73e-3, 6.0e-3))], INK)
    pen.text(61e-3, 0.5e-3, "lamp, hard shadow", LABEL, align=0.5)
    _verdict(pen, (72e-3, 20e-3), good=False)


def draw_camera(pen: Pen, distances: tuple[float, float], tilt_deg: float) -> None:
    """A camera over the board, and where it may be.

    Args:
        pen: draws in the box.
        distances: of the camera from the middle of the board, least and greatest [m].
        tilt_deg: greatest angle off the vertical [deg].
    """
    foot, reach = np.array([40e-3, 3e-3]), 21e-3
    pen.line((18e-3, 3e-3), (62e-3, 3e-3), width=0.9e-3)
    around = np.radians(np.linspace(-tilt_deg, tilt_deg, 30))
    rays = np.column_stack([np.sin(around), np.cos(around)])
    pen.area([np.concatenate([foot + reach * rays, foot + 0.5 * reach * rays[::-1]])], FIT)
    pen.line((40e-3, 3e-3), (40e-3, 25e-3), width=0.2e-3, color=FAINT, dash=1e-3)
    edge = foot + 1.1 * reach * rays[-1]
    pen.line((40e-3, 3e-3), (float(edge[0]), float(edge[1])), width=0.2e-3, color=FAINT, dash=1e-3)
    at = foot + 0.78 * reach * rays[8]
    along = -rays[8]
    across = np.array([-along[1], along[0]])
    for shape in (
        ((-2.0, 2.0), (-2.0, -2.0), (1.0, -2.0), (1.0, 2.0)),
        ((1.0, 1.0), (1.0, -1.0), (2.6, -1.6), (2.6, 1.6)),
    ):
        pen.area([np.array([at + 1e-3 * (a * along + b * across) for a, b in shape])], INK)
    pen.text(58.5e-3, 17e-3, f"{tilt_deg:g}°", LABEL)
    pen.text(2e-3, 18e-3, f"{distances[0]:.1f} to {distances[1]:.1f} m", LABEL, font=BOLD)


def draw_placing(pen: Pen) -> None:
    """An object that is set down on its silhouette."""
    sheet = np.array([[8e-3, 3e-3], [62e-3, 3e-3], [72e-3, 14e-3], [18e-3, 14e-3]])
    pen.area([sheet], PAPER)
    pen.outline([sheet], 0.25e-3, INK)
    shape = _disc((40e-3, 8.5e-3), 8e-3, 0.42)
    pen.area([shape], (0.72, 0.82, 0.90))
    pen.outline([shape], 0.3e-3, (0.25, 0.45, 0.60))
    pen.outline([_disc((40e-3, 8.5e-3), 6e-3, 0.42)], 0.6e-3, (0.10, 0.28, 0.42))
    base, top = 15.5e-3, 22.5e-3
    pen.area([rectangle((34e-3, base), (46e-3, top))], SOFT)
    pen.area([_disc((40e-3, base), 6e-3, 0.25)], SOFT)
    pen.area([_disc((40e-3, top), 6e-3, 0.25)], WHITE)
    pen.outline([_disc((40e-3, top), 6e-3, 0.25)], 0.25e-3, INK)
    pen.line((34e-3, top), (34e-3, base), width=0.25e-3)
    pen.line((46e-3, top), (46e-3, base), width=0.25e-3)
    _arrow(pen, (52e-3, 21e-3), (52e-3, 12e-3), GOOD)


def _sheet(pen: Pen, lower: Spot, upper: Spot) -> None:
    pen.area([rectangle(lower, upper)], PAPER)
    pen.outline([rectangle(lower, upper)], 0.25e-3, INK)


def _verdict(pen: Pen, at: Spot, *, good: bool) -> None:
    """A tick or a cross, 5 mm wide, with its lower left corner at a point."""
    x, y = at
    if good:
        pen.line((x, y + 2e-3), (x + 1.6e-3, y), (x + 5e-3, y + 5e-3), width=1e-3, color=GOOD)
    else:
        pen.line((x, y), (x + 4.5e-3, y + 4.5e-3), width=1e-3, color=BAD)
        pen.line((x, y + 4.5e-3), (x + 4.5e-3, y), width=1e-3, color=BAD)


def _arrow(pen: Pen, start: Spot, tip: Spot, color: Rgb) -> None:
    begin, end = np.array(start), np.array(tip)
    along = (end - begin) / np.linalg.norm(end - begin)
    across = np.array([-along[1], along[0]])
    neck = end - 2.2e-3 * along
    pen.line(start, (float(neck[0]), float(neck[1])), width=THICK, color=color)
    pen.area([np.array([end, neck + 1.1e-3 * across, neck - 1.1e-3 * across])], color)


def _scissors(pen: Pen, at: Spot) -> None:
    """Open scissors whose blades meet left of a point."""
    x, y = at
    for side in (1.0, -1.0):
        pen.line((x - 4e-3, y + side * 1.2e-3), (x + 5e-3, y - side * 1.6e-3), width=THICK)
        pen.circle(x + 6.8e-3, y - side * 2.2e-3, 1.8e-3, INK, THICK)


def _disc(middle: Spot, radius: float, flat: float = 1.0) -> Array:
    """(40, 2) a circle's outline, or an ellipse's whose height is a share of its width."""
    around = np.linspace(0.0, 2 * math.pi, 40, endpoint=False)
    return np.array(middle) + radius * np.column_stack([np.cos(around), flat * np.sin(around)])
