"""Layout of an object gallery: one row per object, in several banks side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array
from burg_drake.visualization.meshcat_drawing import VIEW_ASPECT
from burg_drake.visualization.object_drawing import box_corners

GALLERY_ELEVATION = np.deg2rad(42.0)
"""Angle by which the camera looks down on the gallery, in radians."""


@dataclass(frozen=True)
class GalleryItem:
    """Something that stands on the floor.

    Attributes:
        lower, upper: (3,) bounds in its own frame [m]; its z axis is up.
        caption: width of the text in front of it [m].
    """

    lower: Array
    upper: Array
    caption: float = 0.0

    @property
    def width(self) -> float:
        """Width along x, with the caption [m]."""
        return max(float(self.upper[0] - self.lower[0]), self.caption)


@dataclass(frozen=True)
class GalleryRow:
    """Items of an object.

    Attributes:
        label: width of the text at the row's start [m].
        columns: items in columns, aligned with the columns of other rows.
        rest: items that follow without alignment.
    """

    label: float
    columns: Sequence[GalleryItem]
    rest: Sequence[GalleryItem]


@dataclass(frozen=True)
class PlacedGalleryRow:
    """Positions of a row.

    Attributes:
        p_WL: (3,) left foot of its label [m].
        p_WI: (3,) origins of its items [m]: the items in columns, then the rest.
        captions: (3,) middle of each item's caption's foot [m].
    """

    p_WL: Array
    p_WI: tuple[Array, ...]
    captions: tuple[Array, ...]


@dataclass(frozen=True)
class GalleryLayout:
    """The gallery.

    Attributes:
        rows: rows in the order given.
        banks: (2, 2) corners (lower, upper) in x and y of each bank's floor [m].
        height: height of the highest item [m].
    """

    rows: tuple[PlacedGalleryRow, ...]
    banks: tuple[Array, ...]
    height: float

    def corners(self) -> Array:
        """(8 B, 3) corners of the banks' boxes [m]."""
        height = self.height
        boxes = (box_corners([*lower, 0.0], [*upper, height]) for lower, upper in self.banks)
        return np.vstack(list(boxes))

    def distance(self) -> float:
        """Distance at which a camera sees the whole gallery, up to a factor [m]."""
        lower, upper = self.corners().min(axis=0), self.corners().max(axis=0)
        return float(
            max((upper - lower)[0] / VIEW_ASPECT, (upper - lower)[1] * np.sin(GALLERY_ELEVATION))
        )


def layout_gallery(
    rows: Sequence[GalleryRow], unit: float, line: float, max_banks: int = 8
) -> GalleryLayout:
    """Places rows in the number of banks that lets the camera come nearest.

    Args:
        rows: at least one row.
        unit: typical size of an object [m].
        line: height of a line of text [m].
        max_banks: largest number of banks, at least 1.
    """
    gap_share = 0.16  # Gap as a share of the gallery's unit.
    layouts = [
        _layout_banks(rows, count, gap_share * unit, line)
        for count in range(1, min(max_banks, len(rows)) + 1)
    ]
    return min(layouts, key=GalleryLayout.distance)


def _layout_banks(rows: Sequence[GalleryRow], count: int, gap: float, line: float) -> GalleryLayout:
    depths = np.array([_row_depth(row, gap, line) for row in rows])
    middle = np.cumsum(depths) - depths / 2.0
    bank_of = np.minimum((middle / depths.sum() * count).astype(int), count - 1)
    placed: list[PlacedGalleryRow] = []
    banks = []
    x = 0.0
    for bank in np.unique(bank_of):
        members = [row for row, b in zip(rows, bank_of, strict=True) if b == bank]
        found, floor = _layout_bank(members, x, gap, line)
        placed += found
        banks.append(floor)
        x = float(floor[1, 0]) + 2.0 * gap
    height = max(float(i.upper[2] - i.lower[2]) for r in rows for i in (*r.columns, *r.rest))
    return _center_layout(GalleryLayout(tuple(placed), tuple(banks), height))


def _center_layout(layout: GalleryLayout) -> GalleryLayout:
    """The same layout with the middle of its floor at the origin."""
    corners = layout.corners()
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2.0 * (1.0, 1.0, 0.0)
    rows = tuple(
        PlacedGalleryRow(
            row.p_WL - middle,
            tuple(p - middle for p in row.p_WI),
            tuple(p - middle for p in row.captions),
        )
        for row in layout.rows
    )
    return GalleryLayout(rows, tuple(bank - middle[:2] for bank in layout.banks), layout.height)


def _layout_bank(
    rows: Sequence[GalleryRow], x0: float, gap: float, line: float
) -> tuple[list[PlacedGalleryRow], Array]:
    """Places rows one in front of the other from y = 0 on; returns them and the bank's floor."""
    columns = max(len(row.columns) for row in rows)
    widths = [max(row.columns[k].width for row in rows) for k in range(columns)]
    start = x0 + gap + max(row.label for row in rows) + gap
    placed, y, right = [], 0.0, start
    for row in rows:
        y -= _row_depth(row, gap, line)
        base = y + gap + 1.5 * line
        x, items = start, []
        for width, item in zip(widths, row.columns, strict=True):
            items.append((x + width / 2.0, item))
            x += width + gap
        for item in row.rest:
            items.append((x + item.width / 2.0, item))
            x += item.width + gap
        right = max(right, x)
        deepest = max(float(i.upper[1] - i.lower[1]) for _, i in items)
        placed.append(
            PlacedGalleryRow(
                p_WL=np.array([x0 + gap, y + gap, 0.0]),
                p_WI=tuple(_standing_position(i, c, base + deepest / 2.0) for c, i in items),
                captions=tuple(np.array([c, y + gap, 0.0]) for c, _ in items),
            )
        )
    return placed, np.array([[x0, y], [right + gap, 0.0]])


def _standing_position(item: GalleryItem, x: float, y: float) -> Array:
    """Origin (3,) of an item that stands on the floor, its middle at x, y."""
    middle = (item.lower + item.upper) / 2.0
    return np.array([x - middle[0], y - middle[1], -item.lower[2]])


def _row_depth(row: GalleryRow, gap: float, line: float) -> float:
    """Depth of a row along y: caption, footprints, and the floor hidden by the highest item."""
    items = (*row.columns, *row.rest)
    deepest = max(float(i.upper[1] - i.lower[1]) for i in items)
    behind = max(
        float(i.upper[2] - i.lower[2]) / np.tan(GALLERY_ELEVATION)
        - (deepest - float(i.upper[1] - i.lower[1])) / 2.0
        for i in items
    )
    return 1.5 * line + max(deepest + max(behind, 0.0), 2.5 * line) + 2.0 * gap
