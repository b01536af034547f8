"""Poses of boards whose markers are shifted: by glued pages, a sheet that bulges, rows that are
exposed one after the other. Where edges are seen then, projections of the moved points say."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.cameras import (
    BoardPose,
    Disturbance,
    DisturbanceFit,
    EdgeViews,
    SheetModes,
    marker_edges,
    perturbed_pose,
    project_edges,
)
from burg_drake.scene import Board
from tests.cameras.board_views import CAMERA, error, view
from tests.cameras.placement_views import INTRINSICS, looking
from tests.cameras.synthetic import ImageDegradation, board_image

BOARD = Board()
VIEW = view((0.29, 0.2), 0.75, 25.0, 40.0, 15.0)
CORNERS = BOARD.layout.p_SQ
CENTER = CORNERS.mean(axis=1)
EDGES = marker_edges(BOARD.layout)
MODES = SheetModes(CORNERS, EDGES.p_SE)
NOISE = 0.05
"""Of an edge's place [pixels]."""
PRIOR = np.diag([0.0] * 6 + [1.0])


def seen_from(X_SC: np.ndarray) -> EdgeViews:
    return project_edges(EDGES, np.arange(800), CAMERA, X_SC)


def fitted(offset: np.ndarray, rng: np.random.Generator) -> Disturbance:
    views = seen_from(VIEW)
    return DisturbanceFit(
        views,
        offset + rng.normal(0.0, NOISE, len(views.which)),
        np.full(len(views.which), NOISE**-2),
        EDGES.marker[views.which],
        MODES,
        CAMERA.height,
    ).fit(PRIOR)


def offsets(p_S: np.ndarray, X_SC: np.ndarray) -> np.ndarray:
    """(N,) from where edges are expected to where those at points (N, 3) are, by projection."""
    views = seen_from(VIEW)
    normal = views.across / np.linalg.norm(views.across, axis=1, keepdims=True)
    at = np.stack(
        [CAMERA.project((p - X[:3, 3]) @ X[:3, :3]) for p, X in zip(p_S, X_SC, strict=True)]
    )
    return ((at - views.at) * normal).sum(axis=1)


def places() -> np.ndarray:
    return EDGES.p_SE[seen_from(VIEW).which]


def still() -> np.ndarray:
    return np.broadcast_to(VIEW, (len(places()), 4, 4))


def off(found: Disturbance) -> np.ndarray:
    return error(perturbed_pose(VIEW, found.step), VIEW)


def sds(found: Disturbance) -> float:
    """Error over what the covariance says, root mean square."""
    e = off(found)
    return float(np.sqrt(e @ np.linalg.solve(found.covariance, e) / 6.0))


def without(offset: np.ndarray) -> float:
    """Error of position of plain least squares [mm]."""
    step = np.linalg.lstsq(seen_from(VIEW).motion, offset, rcond=None)[0]
    return 1e3 * float(np.linalg.norm(error(perturbed_pose(VIEW, step), VIEW)[3:]))


def test_a_sheet_that_is_as_it_should_be() -> None:
    rng = np.random.default_rng(0)
    found = [fitted(np.zeros(len(places())), rng) for _ in range(20)]
    assert all(f.in_plane < 1e-4 and f.out_of_plane < 2e-4 and f.rows < 0.2 for f in found)
    # 1 if shifts were known not to be; what they may be is in the covariance, too.
    assert 0.25 < np.mean([sds(f) ** 2 for f in found]) < 1.3


def test_pages_glued_beside_their_places() -> None:
    found, plain = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        p = places()
        page = (p[:, 0] > 0.297).astype(int) + 2 * (p[:, 1] > 0.21)
        shift = rng.uniform(-5e-4, 5e-4, (4, 2))
        shift -= shift[(CENTER[:, 0] > 0.297).astype(int) + 2 * (CENTER[:, 1] > 0.21)].mean(axis=0)
        p[:, :2] += shift[page]
        seen = offsets(p, still())
        plain.append(without(seen))
        found.append(fitted(seen, rng))
    assert np.median([np.linalg.norm(off(f)[3:]) * 1e3 for f in found]) < np.median(plain)
    assert np.median(plain) > 0.8
    assert 2e-4 < np.median([f.in_plane for f in found]) < 1.5e-3
    assert np.sqrt(np.mean([sds(f) ** 2 for f in found])) < 3.0


def test_a_sheet_that_bulges() -> None:
    found, plain, heights = [], [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        p, middle = places(), rng.uniform(0.1, 0.4, 2)
        p[:, 2] += 2e-3 * np.exp(-((p[:, :2] - middle) ** 2).sum(axis=1) / 2 / 0.1**2)
        # S is the plane that fits best.
        A = np.column_stack([np.ones(len(p)), p[:, :2]])
        p[:, 2] -= A @ np.linalg.lstsq(A, p[:, 2], rcond=None)[0]
        seen = offsets(p, still())
        plain.append(without(seen))
        heights.append(np.abs(p[:, 2]).max())
        found.append(fitted(seen, rng))
    assert np.median([np.linalg.norm(off(f)[3:]) * 1e3 for f in found]) < 0.7 * np.median(plain)
    assert [f.out_of_plane for f in found] == pytest.approx(heights, abs=6e-4)
    assert np.sqrt(np.mean([sds(f) ** 2 for f in found])) < 3.0


def test_an_edge_that_curls() -> None:
    """It rises most beyond the middles of the outermost markers."""

    def height(p: np.ndarray) -> np.ndarray:
        return 6e-3 * (1.0 - np.minimum(p[..., 0] / 0.15, 1.0)) ** 2

    corners, p = CORNERS.reshape(-1, 3), places()
    A = [np.column_stack([np.ones(len(q)), q[:, :2]]) for q in (corners, p)]
    p[:, 2] = height(p) - A[1] @ np.linalg.lstsq(A[0], height(corners), rcond=None)[0]
    seen = offsets(p, still())
    found = [fitted(seen, np.random.default_rng(seed)) for seed in range(8)]
    assert np.median([np.linalg.norm(off(f)[3:]) * 1e3 for f in found]) < 0.2 * without(seen)
    # 1.2 with heights by the middles
    assert np.sqrt(np.mean([sds(f) ** 2 for f in found])) < 0.9


def test_rows_that_are_exposed_one_after_the_other() -> None:
    rng = np.random.default_rng(2)
    # 2 pixels from the first row to the last one, by a turn of the camera.
    twist = np.r_[2.0 / CAMERA.focal[0] * np.array([0.6, -0.7, 0.4]), 0.0, 0.0, 0.0]
    row = seen_from(VIEW).at[:, 1] / CAMERA.height - 0.5
    seen = offsets(places(), np.stack([perturbed_pose(VIEW, r * twist) for r in row]))
    found = fitted(seen, rng)
    assert found.rows == pytest.approx(2.0, rel=0.35)
    assert 1e3 * np.linalg.norm(off(found)[3:]) < 0.5 * without(seen)
    assert sds(found) < 2.5


def test_a_print_that_is_longer_along_y() -> None:
    p = places()
    p[:, 1] *= 1.006
    p[:, :2] /= np.sqrt(1.006)
    found = fitted(offsets(p, still()), np.random.default_rng(3))
    assert found.aspect == pytest.approx(0.006, abs=5e-4)
    assert found.shifts.in_plane == 0.0


def test_patterns_neither_shift_nor_turn_the_sheet() -> None:
    modes = SheetModes(CORNERS, CENTER)
    x, y = (CENTER[:, :2] - CENTER[:, :2].mean(axis=0)).T
    whole = [np.c_[np.ones(54), 0 * x], np.c_[0 * x, np.ones(54)], np.c_[-y, x]]
    for moved in whole:
        assert np.abs(np.einsum("mi,mik->k", moved, modes.in_plane)).max() < 0.02
    corners = CORNERS.reshape(-1, 3)
    modes = SheetModes(CORNERS, corners)
    for tilted in (np.ones(216), *(corners[:, :2] - corners[:, :2].mean(axis=0)).T):
        assert np.abs(tilted @ modes.out_of_plane).max() < 0.05


def test_unclear_markers_of_a_far_camera_are_not_taken_for_shifted_ones() -> None:
    """1.3 mm off if each is looked for beside its place."""
    X_SC = looking(np.array([1.0, 0.76, 1.05]), np.array([0.3, 0.2, 0.0]))
    look = ImageDegradation(blur=0.7, noise=2.0)
    image = board_image(BOARD, INTRINSICS, X_SC, look=look, rng=np.random.default_rng(0))
    found = BoardPose(BOARD, INTRINSICS).estimate(image)
    assert found.valid
    assert np.linalg.norm(found.X_SC[:3, 3] - X_SC[:3, 3]) < 0.8e-3
