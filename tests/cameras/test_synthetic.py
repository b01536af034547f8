"""Synthetic images: edges, light, blur and noise are what closed form says."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.cameras import Intrinsics
from burg_drake.core import InvalidInputError
from burg_drake.scene import Board, Markers
from tests.cameras.synthetic import (
    COLORS,
    ImageDegradation,
    board_depth,
    board_image,
    covers_of,
    light_of,
)

CAMERA = Intrinsics(width=160, height=120, focal=(200.0, 200.0), center=(79.5, 59.5))
BOARD = Board(size=(0.2, 0.14), markers=Markers(count=(1, 1)))
PAPER, INK = light_of(COLORS[:2, 0])


def above(x: float, y: float, z: float) -> np.ndarray:
    """A camera over a point, its x along S's x."""
    X_SC = np.diag([1.0, -1.0, -1.0, 1.0])
    X_SC[:3, 3] = x, y, z
    return X_SC


@pytest.mark.parametrize("shift", np.linspace(0.0, 0.0017, 7))
def test_an_edge_lies_where_the_pinhole_puts_it(shift: float) -> None:
    X_SC = above(0.08 + shift, 0.07 + 0.4 * shift, 0.4)
    image = light_of(board_image(BOARD, CAMERA, X_SC))
    left, upper = BOARD.layout.p_SQ[0, 0, :2]
    right, lower = BOARD.layout.p_SQ[0, 2, :2]
    cell = BOARD.layout.side / BOARD.layout.cells
    # The frame of a marker is black: the mean over it and the paper beside it gives the edge, with
    # pixel centres at integers.
    u = CAMERA.center[0] + 200.0 * (left - X_SC[0, 3]) / 0.4
    v = CAMERA.center[1] - 200.0 * ((upper + lower) / 2 - X_SC[1, 3]) / 0.4
    v0 = round(CAMERA.center[1] - 200.0 * (upper - 0.5 * cell - X_SC[1, 3]) / 0.4)
    first, row = round(u) - 3, image[v0, :, 0]
    ink = (PAPER - row[first : round(u) + 4]).sum() / (PAPER - INK)
    assert round(u) + 3.5 - ink == pytest.approx(u, abs=0.02)
    w = CAMERA.center[0] + 200.0 * (right - X_SC[0, 3]) / 0.4
    ink = (PAPER - row[round(u) + 3 : round(w) + 4]).sum() / (PAPER - INK)
    assert round(u) + 2.5 + ink == pytest.approx(w, abs=0.02)
    assert 0 < v < CAMERA.height


def test_edges_lie_right_on_average_within_a_hundredth_of_a_pixel() -> None:
    errors = []
    for shift in np.linspace(0.0, 0.002, 40, endpoint=False):  # a pixel of 2 mm
        X_SC = above(0.1 + shift, 0.07, 0.4)
        image = light_of(board_image(BOARD, CAMERA, X_SC))[:, :, 0]
        left, upper = BOARD.layout.p_SQ[0, 0, :2]
        u = CAMERA.center[0] + 200.0 * (left - X_SC[0, 3]) / 0.4
        v = round(CAMERA.center[1] - 200.0 * (upper - 0.003 - 0.07) / 0.4)
        row, end = image[v], round(u) + 4
        errors.append(end - 0.5 - (PAPER - row[end - 8 : end]).sum() / (PAPER - INK) - u)
    assert abs(np.mean(errors)) < 0.003
    assert np.abs(errors).max() < 0.02


def test_a_lens_moves_what_is_seen_as_the_intrinsics_say() -> None:
    lens = Intrinsics(
        width=160, height=120, focal=(200.0, 200.0), center=(79.5, 59.5), distortion=(0.3, 0, 0, 0)
    )
    X_SC = above(0.17, 0.1, 0.4)
    image = light_of(board_image(BOARD, lens, X_SC))[:, :, 0]
    p = BOARD.layout.p_SQ[0]
    edge = 0.5 * (p[0] + p[3])  # on the left border
    edge[1] = p[0, 1] - 0.003
    u, v = lens.project((edge - X_SC[:3, 3]) @ X_SC[:3, :3])
    row = image[round(v)]
    end = round(u) + 3
    assert end - 0.5 - (PAPER - row[end - 7 : end]).sum() / (PAPER - INK) == pytest.approx(
        u, abs=0.1
    )
    plain = CAMERA.project((edge - X_SC[:3, 3]) @ X_SC[:3, :3])
    assert abs(plain[0] - u) > 0.5


def test_blur_noise_and_light_do_what_they_say() -> None:
    X_SC = above(0.1, 0.07, 0.4)
    clean = board_image(BOARD, CAMERA, X_SC).astype(float)
    noisy = board_image(
        BOARD, CAMERA, X_SC, look=ImageDegradation(noise=3.0), rng=np.random.default_rng(0)
    ).astype(float)
    assert (noisy - clean)[:, 60:90].std() == pytest.approx(3.0, rel=0.05)
    light = light_of(clean)
    dark = light_of(board_image(BOARD, CAMERA, X_SC, look=ImageDegradation(gain=0.5)))
    assert np.abs(dark - 0.5 * light).max() < 0.005
    blurred = light_of(board_image(BOARD, CAMERA, X_SC, look=ImageDegradation(blur=1.0)))
    assert blurred.mean() == pytest.approx(light.mean(), rel=2e-3)
    assert np.abs(np.diff(blurred, axis=1)).max() < 0.6 * np.abs(np.diff(light, axis=1)).max()


def test_covers_hide_the_share_that_was_asked_for() -> None:
    layout = Board().layout
    for partial in (False, True):
        covers, seen = covers_of(layout, 0.55, np.random.default_rng(1), partial=partial)
        assert len(covers) == 30 and len(seen) == 24
    # Whole markers are under their covers: every corner of the hidden ones.
    covers, seen = covers_of(layout, 0.55, np.random.default_rng(1))
    hidden = layout.p_SQ[~np.isin(layout.ids, seen)]
    x, y, a, b, angle = covers.T[:, :, None, None]
    dx, dy = hidden[None, ..., 0] - x, hidden[None, ..., 1] - y
    inside = np.abs(np.cos(angle) * dx + np.sin(angle) * dy) < a
    inside &= np.abs(np.cos(angle) * dy - np.sin(angle) * dx) < b
    assert inside.any(axis=0).all()


def test_depth_of_a_camera_that_looks_straight_down_is_its_height() -> None:
    assert np.allclose(board_depth(CAMERA, above(0.1, 0.05, 0.37)), 0.37)


def test_bad_input() -> None:
    with pytest.raises(InvalidInputError, match="noise needs a random generator"):
        board_image(BOARD, CAMERA, above(0.1, 0.07, 0.4), look=ImageDegradation(noise=1.0))
    with pytest.raises(InvalidInputError, match="above the table and look down"):
        board_image(BOARD, CAMERA, np.eye(4))
