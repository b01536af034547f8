"""Shadows on the board, drawn by closed form: they are no objects, and hide none."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.cameras import StepLines, empty_board, fit_steps, locate_objects
from burg_drake.core import Array
from tests.cameras.plates import BOARD, INTRINSICS, X_SC, aligner, cover, drawing, plate
from tests.cameras.synthetic import ImageDegradation
from tests.thorough import thorough

SIZE, TARGET = (0.12, 0.07), (0.30, 0.19, 0.3)
Q = np.array([0.018, -0.012, np.deg2rad(14.0)])
SHADE = 0.25
"""Light in a shadow over that beside it."""
LOOK = ImageDegradation(blur=0.7, noise=2.0)


def shadow(softness: float) -> Array:
    """(240, 320) a broad band of shade across the picture and the plate's edges.

    Args:
        softness: of its edges [pixels].
    """
    v, u = np.mgrid[:240, :320].astype(float)
    away = np.abs(0.6 * u + 0.8 * v - 190.0) - 45.0
    return SHADE + (1.0 - SHADE) * np.clip(0.5 + away / softness, 0.0, 1.0)


@pytest.mark.parametrize("softness", [1.0, thorough(25.0)])
def test_a_shadow_is_no_object(softness: float) -> None:
    light = shadow(softness)
    picture = empty_board(BOARD, drawing([], LOOK, light), INTRINSICS.K, X_SC)
    assert picture is not None
    dark = picture.sheet & (light < 0.5)
    assert dark.sum() > 5000
    assert (picture.evidence[picture.sheet] > 0.3).mean() < 0.003
    assert picture.evidence[dark].mean() < -0.4  # the pattern is seen, and says so
    bright = drawing([], LOOK)
    whole = empty_board(BOARD, bright, INTRINSICS.K, X_SC)
    assert whole is not None  # levels are those of paper without shadow
    ratio = picture.color[picture.sheet].mean() / whole.color[picture.sheet].mean()
    assert ratio == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize("softness", [1.0, thorough(25.0)])
def test_a_plate_that_a_shadow_crosses_is_measured(softness: float) -> None:
    there = aligner(drawing([cover(SIZE, TARGET, Q)], LOOK, shadow(softness)))
    found = locate_objects(there, {"plate": plate(SIZE, TARGET)})["plate"].alignment
    assert found is not None
    assert np.abs(found.q - Q)[:2].max() < 5e-4
    assert abs(found.q[2] - Q[2]) < np.deg2rad(0.4)
    assert (np.abs(found.q - Q) < 4.0 * np.sqrt(np.diag(found.covariance))).all()
    assert found.agreement > 0.8


def lines(color: tuple[float, ...], shade: float, offset: float, noise: float) -> StepLines:
    """Two hundred lines across an object's edge on white paper, beside which a shadow begins that
    fades within two pixels."""
    t, blur, paper = np.arange(-4.5, 4.6, 0.5), 0.8, 0.7
    rng = np.random.default_rng(1)
    fine = np.arange(-12.0, 12.0, 0.02)
    lit = paper * (1.0 - (1.0 - shade) * np.clip(1.0 - (fine - offset) / 2.0, 0.0, 1.0))
    sharp = np.where((fine < offset)[:, None], np.array(color), lit[:, None])
    kernel = np.exp(-0.5 * (np.arange(-4.0, 4.0, 0.02) / blur) ** 2)
    soft = np.stack([np.convolve(c, kernel / kernel.sum(), "same") for c in sharp.T], axis=-1)
    seen = soft[np.searchsorted(fine, t)]
    light = seen + noise * rng.normal(size=(200, len(t), 3))
    return StepLines(
        t=t,
        light=light,
        behind=np.full_like(light, paper),
        color=np.tile(color, (200, 1)),
        tone=np.ones((200, 3)),
        strip=np.full(200, -np.inf),
        used=np.broadcast_to((t > -2.5) & (t < 4.4), (200, len(t))),
    )


def test_a_colored_edge_is_found_in_the_shadow_that_begins_there() -> None:
    offsets, found = np.array([-0.4, -0.2, 0.0, 0.2, 0.4]), []
    for offset in offsets:
        steps = fit_steps(lines((0.30, 0.20, 0.05), 0.4, offset, 0.01), 0.8, 0.01, 0.7)
        found.append(np.median(steps.offset))
    # The shadow's own slope beside the edge takes a part of the step with it, alike everywhere.
    slope, shift = np.polyfit(offsets, found, 1)
    assert slope == pytest.approx(1.0, abs=0.3)
    assert 0.0 <= shift < 0.35


def test_a_grey_edge_in_a_shadow_is_less_sure_than_a_colored_one() -> None:
    """Nothing tells the gray of shaded paper from that of the object."""
    deviations = [
        np.median(np.sqrt(fit_steps(lines(color, 0.4, 0.0, 0.01), 0.8, 0.01, 0.7).variance))
        for color in ((0.25, 0.25, 0.25), (0.35, 0.20, 0.05))
    ]
    assert deviations[0] > 1.5 * deviations[1]
