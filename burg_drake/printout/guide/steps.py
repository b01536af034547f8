"""What is to be done between the pages of a printout and objects at their places, in steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from burg_drake.printout.drawings import Drawing
from burg_drake.printout.guide.sketches import (
    BOX,
    PLAN_HEIGHT,
    draw_camera,
    draw_cutting,
    draw_flatness,
    draw_gluing,
    draw_light,
    draw_measuring,
    draw_placing,
    draw_plan,
    draw_scale,
)
from burg_drake.printout.pen import Pen
from burg_drake.printout.tiling import Tiling

NEAREST, FARTHEST = 11.0, 22.0
"""Distances of the camera in sides of a marker: 0.5 to 1 m for 45 mm. How accurate poses are there
is said in docs/concepts/camera_accuracy.md."""
TILT_DEG = 50.0
"""Greatest angle off the vertical there [deg]."""


@dataclass(frozen=True)
class Step:
    """One thing to do.

    Attributes:
        heading: what, in a word or two.
        words: paragraphs.
        draw: its sketch, in a box of `sketches.BOX`; None without.
        height: of the sketch [m].
    """

    heading: str
    words: tuple[str, ...]
    draw: Callable[[Pen], None] | None = None
    height: float = BOX[1]


@dataclass(frozen=True, kw_only=True)
class BoardFacts:
    """What the steps depend on.

    Attributes:
        size: extents of the board [m].
        side: of a marker [m].
        margin: that pages leave white [m].
        measured: what rulers of 100 mm along x and y measured before, for which all is drawn larger
            [m].
        tiling: the pages.
        objects: that are drawn; none if there are only markers.
        losses: what the margins of printers cut off, a sentence each.
    """

    size: tuple[float, float]
    side: float
    margin: float
    measured: tuple[float, float]
    tiling: Tiling
    objects: list[Drawing]
    losses: tuple[str, ...]


def guide_steps(facts: BoardFacts) -> list[Step]:
    """The steps for a board, in their order."""
    steps = [_print(facts), _measure(facts)]
    if len(facts.tiling.tiles) > 1:
        steps += _assembly(facts)
    steps += [_flatten(), _light(), _look(facts)]
    return [*steps, *([_place()] if facts.objects else [])]


def _print(facts: BoardFacts) -> Step:
    white = f"The printer may leave {1e3 * facts.margin:g} mm white on each side."
    lost = facts.losses or ("Nothing is cut off by that.",)
    scale = "Print at 100 %, on matt paper; not “fit to page”, not “shrink to printable area”."
    return Step("Print", (scale, " ".join((white, *lost))), draw_scale)


def _measure(facts: BoardFacts) -> Step:
    words = "On every page hold a steel ruler to the two printed rulers, along x and along y."
    remedy = (
        "Each must be 100 mm long, to 0.2 mm. If not, print again and tell the program what they"
        " measure: it draws all larger or smaller by as much."
    )
    if facts.measured != (0.1, 0.1):
        x, y = (f"{1e3 * m:g}" for m in facts.measured)
        remedy = (
            f"These pages are drawn for a printer that made 100 mm {x if x == y else f'{x} x {y}'}"
            " mm. " + remedy
        )
    return Step("Measure", (words, remedy), draw_measuring)


def _assembly(facts: BoardFacts) -> list[Step]:
    tiling = facts.tiling
    columns, rows = len(tiling.x_cuts) + 1, len(tiling.y_cuts) + 1
    plan = Step(
        "Plan of pages",
        (
            f"{len(tiling.tiles)} pages, {columns} side by side in {rows} row"
            f"{'s' if rows > 1 else ''}. They are numbered from the upper left, row by row.",
        ),
        partial(draw_plan, tiling=tiling, size=facts.size, objects=facts.objects),
        PLAN_HEIGHT,
    )
    cut = Step(
        "Cut",
        (
            "Cut each page along the dashed lines that say CUT, on its left and above, with a knife"
            " and a ruler. What lies beyond the other dashed lines stays.",
        ),
        draw_cutting,
    )
    strip = "onto the strips of those before it" if tiling.flap else "edge to edge with the others"
    glue = Step(
        "Glue",
        (
            f"In the order of the numbers: lay each page {strip}, so that the crosses in circles"
            " meet, and glue. Check every cross before the glue sets.",
        ),
        partial(draw_gluing, flap=tiling.flap),
    )
    return [plan, cut, glue]


def _flatten() -> Step:
    words = (
        "Glue the sheet, all over, onto a flat, stiff plate of wood, foam or aluminium. A sheet"
        " that waves moves the pose that a camera finds."
    )
    return Step("Keep it flat", (words,), draw_flatness)


def _light() -> Step:
    words = (
        "Soft, even light. No lamp or sun whose shadows have hard edges or that shines back from"
        " the paper; white paper must not be overexposed."
    )
    return Step("Light", (words,), draw_light)


def _look(facts: BoardFacts) -> Step:
    near, far = (times * facts.side for times in (NEAREST, FARTHEST))
    words = (
        f"From {near:.1f} to {far:.1f} m away (with 640 x 480 pixels; twice as far with twice as"
        f" many), up to {TILT_DEG:g}° off the vertical. As many markers as possible in sight;"
        " nothing moves, nothing is blurred."
    )
    sketch = partial(draw_camera, distances=(near, far), tilt_deg=TILT_DEG)
    return Step("Camera", (words,), sketch)


def _place() -> Step:
    words = (
        "Each object on its silhouette. The thick line is where it touches the sheet, the thin one"
        " its outline from above; darker is closer to the sheet. Begin at the far edge. Then let a"
        " camera check: burg-drake ar, or burg-drake camera placement."
    )
    return Step("Place the objects", (words,), draw_placing)
