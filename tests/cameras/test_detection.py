"""Markers are found, told apart, and in the right order of corners."""

from __future__ import annotations

import cv2
import numpy as np

from burg_drake.cameras import (
    NEIGHBOUR_EDGES,
    MarkerDetector,
    find_foreign_markers,
    grey_image,
    marker_edges,
    perturbed_pose,
    project_edges,
    read_cells,
)
from burg_drake.scene import Board, Markers, marker_dictionary
from tests.cameras.board_views import SMALL, view
from tests.cameras.synthetic import board_image

BOARD = Board(size=(0.3, 0.21), markers=Markers(first_id=20))
NEAR = view((0.15, 0.105), 0.52, 20.0, 200.0, 100.0)


def test_corners_are_those_of_the_layout() -> None:
    seen = MarkerDetector(BOARD.layout).detect(grey_image(board_image(BOARD, SMALL, NEAR)))
    assert len(seen.index) == 12
    p_C = (BOARD.layout.p_SQ[seen.index] - NEAR[:3, 3]) @ NEAR[:3, :3]
    assert np.abs(SMALL.project(p_C) - seen.corners).max() < 1.5


def test_the_same_markers_are_found_as_by_opencv() -> None:
    image = board_image(BOARD, SMALL, NEAR).astype(float)
    noisy = image + np.random.default_rng(0).normal(0.0, 6.0, image.shape)
    grey = grey_image(np.clip(noisy, 0, 255).astype(np.uint8))
    for turns in range(4):
        turned = np.ascontiguousarray(np.rot90(grey, turns))
        seen = MarkerDetector(BOARD.layout).detect(turned)
        opencv = cv2.aruco.ArucoDetector(marker_dictionary(BOARD.layout.dictionary))
        corners, ids, _ = opencv.detectMarkers(turned)
        by_id = dict(zip(ids.ravel().tolist(), corners, strict=True))
        assert set(BOARD.layout.ids[seen.index]) == set(by_id) == set(range(20, 32))
        for index, found in zip(seen.index, seen.corners, strict=True):
            assert np.abs(by_id[BOARD.layout.ids[index]][0] - found).max() < 1.5


def test_cells_of_a_quadrilateral_are_read_in_the_order_of_its_corners() -> None:
    black = np.random.default_rng(2).random((8, 8)) < 0.5
    picture = np.where(black, 30, 220).astype(np.uint8).repeat(12, axis=0).repeat(12, axis=1)
    corners = np.array([[20.0, 30.0], [150.0, 14.0], [170.0, 160.0], [10.0, 140.0]])
    square = np.array([[0, 0], [96, 0], [96, 96], [0, 96]]) - 0.5
    H = cv2.getPerspectiveTransform(square.astype(np.float32), corners.astype(np.float32))
    seen = cv2.warpPerspective(picture, H, (180, 180), borderValue=128)
    turned = np.stack([np.roll(corners, -turns, axis=0) for turns in range(4)])
    cells, contrast = read_cells(seen, turned, 8)
    for turns in range(4):
        assert np.array_equal(cells[turns], np.rot90(black, turns))
    assert np.all(np.abs(contrast - 190.0) < 5.0)


def test_a_marker_that_is_there_twice_is_left_out() -> None:
    image = grey_image(board_image(BOARD, SMALL, NEAR))
    double = np.hstack([image, image])
    assert len(MarkerDetector(BOARD.layout).detect(double).index) == 0


def test_white_cells_in_a_border_are_forgiven_up_to_a_share() -> None:
    """Spots on border cells leave the outline as it is. 0.35 of 28 cells are 9.8.

    OpenCV takes that share of the cells inside, 12 of 36.
    """
    layout = Board(size=(0.3, 0.21), markers=Markers(first_id=20)).layout
    dictionary = marker_dictionary(layout.dictionary)
    cell, cells = 24, layout.cells
    opencv = cv2.aruco.ArucoDetector(dictionary)
    corner = [(0, k) for k in range(cells)] + [(k, 0) for k in range(1, cells)]
    assert cells == 8 and len(corner) == 15
    found = {}
    for spots in (0, 9, 10, 15):
        marker = cv2.aruco.generateImageMarker(dictionary, 22, cells * cell)
        for row, column in corner[:spots]:
            y, x = row * cell, column * cell
            marker[y + 3 : y + cell - 3, x + 3 : x + cell - 3] = 255
        image = np.pad(marker, 3 * cell, constant_values=255)
        ids = opencv.detectMarkers(image)[1]
        seen = MarkerDetector(layout).detect(image)
        found[spots] = len(seen.index), 0 if ids is None else len(ids)
    assert found == {0: (1, 1), 9: (1, 1), 10: (0, 1), 15: (0, 0)}


def test_markers_of_others_are_named() -> None:
    image = grey_image(board_image(BOARD, SMALL, NEAR))
    other = find_foreign_markers(image, Board(markers=Markers(dictionary="5X5_250")).layout)
    assert other is not None
    assert other.dictionary == "ARUCO_MIP_36h12"
    assert set(other.ids) == set(range(20, 32))
    assert find_foreign_markers(np.full_like(image, 128), BOARD.layout) is None


def test_edges_are_all_changes_of_color() -> None:
    layout = BOARD.layout
    edges = marker_edges(layout)
    white = np.pad(~layout.black, ((0, 0), (1, 1), (1, 1)), constant_values=True)
    across = (white[:, :, 1:] != white[:, :, :-1]).sum(), (white[:, 1:] != white[:, :-1]).sum()
    assert [(edges.axis == axis).sum() for axis in (0, 1)] == list(across)
    # What lies a quarter of a cell before and behind an edge, looked up in the layout.
    cell = layout.side / layout.cells
    for side, step in ((-0.25, -0.5), (0.25, 0.5)):
        p = edges.p_SE[:, :2] + side * cell * np.eye(2)[edges.axis]
        upper_left = layout.p_SQ[edges.marker, 0, :2]
        column, row = np.floor((p - upper_left) * [1, -1] / cell).astype(int).T
        is_white = white[edges.marker, row + 1, column + 1]
        assert np.array_equal(is_white, edges.steps[:, 1, NEIGHBOUR_EDGES] * step > 0)
    # Every beginning is spread over all markers.
    assert np.ptp(np.bincount(edges.marker[:60], minlength=12)) <= 1


def test_motion_and_print_are_derivatives() -> None:
    lens = SMALL.__class__(
        width=320,
        height=240,
        focal=(420, 410),
        center=(160, 118),
        distortion=(0.1, -0.2, 1e-3, 2e-3),
    )
    edges = marker_edges(BOARD.layout)
    which = np.arange(len(edges.marker))
    views = project_edges(edges, which, lens, NEAR)
    normal = views.across / np.linalg.norm(views.across, axis=1, keepdims=True)
    h = 1e-5
    for k, unit in enumerate(np.eye(6)):
        ahead, back = (
            project_edges(edges, views.which, lens, perturbed_pose(NEAR, s * h * unit))
            for s in (1, -1)
        )
        change = ((ahead.at - back.at) * normal).sum(axis=1) / (2 * h)
        assert np.allclose(change, views.motion[:, k], rtol=1e-3, atol=0.05), k
    longer = marker_edges(BOARD.layout, (1 - h, 1 + h))
    change = ((project_edges(longer, views.which, lens, NEAR).at - views.at) * normal).sum(
        axis=1
    ) / h
    assert np.allclose(change, views.print[:, 0], rtol=1e-2, atol=0.05)


def test_a_point_in_sight_stays_while_the_camera_turns_about_it() -> None:
    point, turn = np.array([0.15, 0.1, 0.0]), np.array([0.1, -0.2, 0.15])
    arm = NEAR[:3, 3] - point
    X_SC = perturbed_pose(NEAR, np.r_[turn, np.cross(turn, arm)], point)
    before, after = ((point - X[:3, 3]) @ X[:3, :3] for X in (NEAR, X_SC))
    assert np.allclose(before, after)
    assert np.allclose(perturbed_pose(NEAR, np.r_[turn, 0, 0, 0])[:3, 3], NEAR[:3, 3])
