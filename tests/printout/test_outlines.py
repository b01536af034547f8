"""Outlines: of masks against the shapes they come from, of markers against OpenCV's filling."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from burg_drake.printout import SheetGrid, SheetLayer, cell_outlines, mask_outlines
from burg_drake.scene import Markers, marker_layout


def area(polygon: np.ndarray) -> float:
    """Signed, counter-clockwise positive."""
    x, y = polygon.T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)


@pytest.mark.parametrize("dictionary", ["ARUCO_MIP_36h12", "4X4_250"])
def test_one_shape_a_marker_fills_its_cells(dictionary: str) -> None:
    markers = Markers(dictionary=dictionary, side=0.03, spacing=0.01)
    for black in marker_layout((0.42, 0.3), markers).black:
        loops = cell_outlines(black)
        assert -sum(area(loop * [1, -1]) for loop in loops) == black.sum()  # clockwise: black
        cells, unit = len(black), 8
        filled = np.zeros((cells * unit, cells * unit), np.uint8)
        # By halves of a cell, so that OpenCV's inclusive edges fall between the samples.
        cv2.fillPoly(filled, [loop.astype(np.int32) * unit for loop in loops], 1)
        np.testing.assert_array_equal(filled[unit // 2 :: unit, unit // 2 :: unit] == 1, black)


def test_random_patterns_with_touching_corners() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        black = rng.random((6, 6)) < 0.5
        loops = cell_outlines(black)
        assert sum(-area(loop * [1, -1]) for loop in loops) == black.sum()
        for loop in loops:  # corners only, along the grid
            steps = np.roll(loop, -1, axis=0) - loop
            assert ((steps == 0).sum(axis=1) == 1).all()
            assert (np.roll(steps, 1, axis=0) * steps == 0).all()


def test_a_ring() -> None:
    grid = SheetGrid((0.1, 0.1), 1e-4)
    rows, columns = np.indices(grid.shape)
    points = grid.points(np.stack([columns, rows], axis=-1))
    distance = np.linalg.norm(points - [0.05, 0.06], axis=-1)
    height = np.where((distance < 0.03) & (distance > 0.01), 0.0, np.inf).astype(np.float32)
    layer = SheetLayer(grid, 0, 0, height, 0.0)
    outer, inner = sorted(mask_outlines(layer, layer.covered), key=lambda p: -abs(area(p)))
    for polygon, radius in ((outer, 0.03), (inner, 0.01)):
        reach = np.linalg.norm(polygon - [0.05, 0.06], axis=1)
        assert np.abs(reach - radius).max() < 1.5e-4
    assert area(outer) * area(inner) < 0.0
