"""What a printer or the edge of the paper takes away: parts of objects, the white of markers."""

from __future__ import annotations

import numpy as np

from burg_drake.core import Array
from burg_drake.printout.sheet import Sheet
from burg_drake.printout.tiling import Tile, Tiling
from burg_drake.scene.document import EDGE, MarkerLayout

LOST = 0.5e-3
"""An object that loses less than this to the page's margin is worth no word [m]."""
USUAL_MARGIN = 4.23e-3
"""What most laser printers leave white on every side, a sixth of an inch [m]; an estimate, of which
the printer's own manual knows better. Inkjet printers mostly leave 3 mm."""


def margin_losses(sheet: Sheet, tiling: Tiling) -> list[str]:
    """What of the objects no page shows, by page; of those beyond the board something else was
    said."""
    beyond = {arrow.name for arrow in sheet.arrows}
    lost = []
    for tile in tiling.tiles:
        for drawing in sheet.drawings:
            loops = [*drawing.outline, *drawing.raised]
            if drawing.name in beyond or not loops:
                continue
            points = _between_cuts(np.concatenate(loops), tile)
            if not len(points):
                continue
            below = np.array(tile.lower) - points.min(axis=0)
            above = points.max(axis=0) - np.array(tile.upper)
            most = float(max(below.max(), above.max()))
            if most > LOST:
                lost.append(
                    f"page {tile.number}: the outermost {1e3 * most:.1f} mm of {drawing.name!r} lie"
                    " in the margin of the page; larger pages have room"
                )
    return lost


def printer_losses(sheet: Sheet, tiling: Tiling) -> list[str]:
    """What usual printers would cut off, by page, of pages whose margin is less than theirs."""
    paper = tiling.paper
    if paper.margin >= USUAL_MARGIN:
        return []
    lower = np.full(2, USUAL_MARGIN)
    upper = np.array([paper.width, paper.height]) - USUAL_MARGIN
    corners = [c[:, :2] for c in sheet.layout.p_SQ]
    outlines = [loop for d in sheet.drawings for loop in (*d.outline, *d.raised)]
    lost = []
    for tile in tiling.tiles:
        shown = np.array([tile.lower, tile.upper]) + tile.p_PS
        cut = []
        for what, shapes in (("markers", corners), ("objects", outlines)):
            parts = [p for shape in shapes if len(p := _between_cuts(shape, tile))]
            if parts:
                points = np.clip(np.concatenate(parts) + tile.p_PS, *shown)
                most = max((lower - points).max(), (points - upper).max())
                cut += [f"{1e3 * most:.1f} mm of {what}"] if most > 1e-4 else []
        if cut:
            lost.append(
                f"page {tile.number}: a printer with a margin of {1e3 * USUAL_MARGIN:.1f} mm, as"
                f" most laser printers have, cuts off {' and '.join(cut)}"
            )
    return lost


def lacking_white(size: tuple[float, float], layout: MarkerLayout) -> list[str]:
    """Markers at the sheet's edge: detectors need white around them, about a cell wide."""
    corners = layout.p_SQ[..., :2].reshape(-1, 2)
    white = min(corners.min(), (np.array(size) - corners).min())
    least = min(layout.side / layout.cells, EDGE)
    if white > least - 1e-9:
        return []
    return [
        f"markers are {1e3 * white:.1f} mm from the edge of the board, but detectors need a white"
        f" border of {1e3 * least:.1f} mm around them; give a larger board or smaller markers"
    ]


def _between_cuts(points: Array, tile: Tile) -> Array:
    """Those of points (N, 2) of the board that belong on a page [m]."""
    low = [-np.inf if c is None else c for c in (tile.cut_left, tile.cut_bottom)]
    high = [np.inf if c is None else c for c in (tile.cut_right, tile.cut_top)]
    return points[((points >= low) & (points <= high)).all(axis=1)]
