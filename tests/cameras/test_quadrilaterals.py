"""Quadrilaterals and their cells, in pictures that OpenCV's own warp draws."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from burg_drake.cameras import MIN_CELL_CONTRAST, find_dark_quadrilaterals, read_cells

CORNERS = np.array([[90.0, 60.0], [210.0, 80.0], [230.0, 190.0], [70.0, 170.0]])
CELLS = 6


def picture(black: np.ndarray, corners: np.ndarray = CORNERS, dark: int = 30) -> np.ndarray:
    """(240, 320) a pattern of black cells, laid over four corners on a light ground."""
    scale = 20
    plain = np.kron(np.where(black, dark, 220), np.ones((scale, scale))).astype(np.uint8)
    at = scale * CELLS * np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32) - 0.5
    H = cv2.getPerspectiveTransform(at.astype(np.float32), corners.astype(np.float32))
    return cv2.warpPerspective(plain, H, (320, 240), borderValue=220)


def test_a_dark_one_is_found_clockwise() -> None:
    # within a window of its border; the thresholded area has an outer and an inner contour
    found = find_dark_quadrilaterals(picture(np.ones((CELLS, CELLS), bool)), 13, 15.0, 100.0)
    outer = max(found, key=lambda q: cv2.contourArea(q.astype(np.float32)))
    first = np.linalg.norm(outer - CORNERS[0], axis=1).argmin()
    # through the middles of dark pixels, about half a pixel inside
    assert np.abs(np.roll(outer, -first, axis=0) - CORNERS).max() < 1.5


def test_small_ones_and_those_at_the_border_are_left_out() -> None:
    image = picture(np.ones((CELLS, CELLS), bool))
    assert len(find_dark_quadrilaterals(image, 13, 15.0, 600.0)) == 0
    assert len(find_dark_quadrilaterals(image[:, 92:], 13, 15.0, 100.0)) == 0


@pytest.mark.parametrize("seed", range(3))
def test_cells_are_read_in_rows_from_the_first_corner(seed: int) -> None:
    black = np.random.default_rng(seed).random((CELLS, CELLS)) < 0.5
    image = picture(black)
    turned = np.stack([np.roll(CORNERS, -k, axis=0) for k in range(4)])
    read, contrast = read_cells(image, turned, CELLS)
    for k in range(4):  # from the next corner on, the pattern looks turned counter-clockwise
        assert np.array_equal(read[k], np.rot90(black, k))
    assert contrast == pytest.approx(np.full(4, 190.0), abs=6.0)


def test_an_even_area_has_no_contrast() -> None:
    noise = np.random.default_rng(0).normal(120.0, 2.0, (240, 320)).astype(np.uint8)
    _, contrast = read_cells(noise, CORNERS[None], CELLS)
    assert contrast[0] < MIN_CELL_CONTRAST
