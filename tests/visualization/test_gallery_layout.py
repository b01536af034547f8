"""Layout of a gallery: nothing overlaps, columns are columns, and all is on the floor."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.visualization import (
    GALLERY_ELEVATION,
    GalleryItem,
    GalleryLayout,
    GalleryRow,
    layout_gallery,
)

UNIT, LINE = 0.2, 0.03


def some_rows(count: int, seed: int = 0) -> list[GalleryRow]:
    rng = np.random.default_rng(seed)

    def item() -> GalleryItem:
        size, offset = rng.uniform(0.02, 0.3, size=3), rng.normal(size=3)
        return GalleryItem(offset - size / 2, offset + size / 2, rng.uniform(0.0, 0.1))

    return [
        GalleryRow(
            rng.uniform(0.1, 0.3),
            [item() for _ in range(3)],
            [item() for _ in range(rng.integers(0, 6))],
        )
        for _ in range(count)
    ]


def boxes(rows: list[GalleryRow], layout: GalleryLayout) -> list[np.ndarray]:
    """(2, 3) bounds of all items in the world, by row."""
    return [
        np.array(
            [
                (p + item.lower, p + item.upper)
                for p, item in zip(placed.p_WI, (*row.columns, *row.rest), strict=True)
            ]
        )
        for row, placed in zip(rows, layout.rows, strict=True)
    ]


@pytest.mark.parametrize("count", [1, 2, 7, 50])
def test_nothing_overlaps_and_all_stands_on_a_floor(count: int) -> None:
    rows = some_rows(count)
    layout = layout_gallery(rows, UNIT, LINE)
    everything = np.concatenate(boxes(rows, layout))
    assert everything[:, 0, 2] == pytest.approx(0.0, abs=1e-12)
    lower, upper = everything[:, 0, :2], everything[:, 1, :2]
    apart = (lower[:, None] >= upper[None]) | (upper[:, None] <= lower[None])
    assert (apart.any(axis=2) | np.eye(len(everything), dtype=bool)).all()
    for low, high in zip(lower, upper, strict=True):
        assert any((low >= b[0]).all() and (high <= b[1]).all() for b in layout.banks)


@pytest.mark.parametrize("count", [2, 9])
def test_no_row_hides_the_captions_of_the_one_behind(count: int) -> None:
    rows = some_rows(count, seed=3)
    layout = layout_gallery(rows, UNIT, LINE)
    found = boxes(rows, layout)
    for k in range(1, count):
        feet = np.array(layout.rows[k - 1].captions)
        if feet[0, 1] < layout.rows[k].captions[0][1]:
            continue  # the next bank
        # where a ray over an item's upper back edge meets the floor
        shade = found[k][:, 1, 1] + found[k][:, 1, 2] / np.tan(GALLERY_ELEVATION)
        assert shade.max() <= feet[:, 1].min() + 1e-9


def test_columns_are_in_line() -> None:
    rows = some_rows(4)
    placed = layout_gallery(rows, UNIT, LINE).rows
    for k in range(3):
        x = [row.captions[k][0] for row in placed]
        assert x == pytest.approx([x[0]] * 4)


def test_the_floor_is_in_the_middle_and_many_rows_have_several_banks() -> None:
    layout = layout_gallery(some_rows(50), UNIT, LINE)
    corners = layout.corners()
    assert (corners.min(axis=0) + corners.max(axis=0))[:2] == pytest.approx([0, 0], abs=1e-12)
    assert len(layout.banks) > 1
    assert len(layout_gallery(some_rows(1), UNIT, LINE).banks) == 1
    width, depth = np.ptp(corners[:, :2], axis=0)
    assert 0.4 < width / (depth * np.sin(GALLERY_ELEVATION)) < 4.0
