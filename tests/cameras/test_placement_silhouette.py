"""Plates on the board, drawn by closed form: the board's picture, the search, the alignment."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.cameras import empty_board, find_places, locate_objects
from burg_drake.core import srgb_to_linear
from tests.cameras.plates import (
    BOARD,
    INTRINSICS,
    VIEW,
    X_SC,
    aligner,
    cover,
    drawing,
    plate,
)
from tests.cameras.synthetic import ImageDegradation, board_image
from tests.thorough import thorough

TARGET = (0.30, 0.19, 0.3)
Q = np.array([0.018, -0.012, np.deg2rad(14.0)])


@pytest.mark.parametrize(
    "look",
    [thorough(ImageDegradation(noise=2.0)), ImageDegradation(blur=1.0, noise=4.0, gain=0.7)],
)
def test_a_plate_is_found_and_measured(look: ImageDegradation) -> None:
    size = (0.12, 0.07)
    there = aligner(drawing([cover(size, TARGET, Q)], look))
    shape = plate(size, TARGET)
    near = [f.q - Q for f in find_places(VIEW, shape, there.evidence)]
    assert min(np.hypot(x, y) for x, y, turn in near if abs(turn) < np.deg2rad(8.0)) < 0.006
    found = locate_objects(there, {"plate": shape})["plate"].alignment
    assert found is not None
    assert np.abs(found.q - Q)[:2].max() < 2e-4
    assert abs(found.q[2] - Q[2]) < np.deg2rad(0.2)
    assert found.agreement > 0.8
    assert (np.abs(found.q - Q) < 4.0 * np.sqrt(np.diag(found.covariance))).all()


def test_a_scaled_print_is_an_empty_board_only_to_who_knows_its_scale() -> None:
    scale = (0.97, 0.98)
    image = board_image(BOARD, INTRINSICS, X_SC, scale=scale)
    known = empty_board(BOARD, image, INTRINSICS.K, X_SC, scale)
    unknown = empty_board(BOARD, image, INTRINSICS.K, X_SC)
    assert known is not None and unknown is not None
    assert (known.evidence[known.sheet] > 0.1).mean() < 0.01
    assert (unknown.evidence[unknown.sheet] > 0.1).mean() > 0.1


def test_an_empty_board_in_uneven_light_is_empty() -> None:
    image = drawing([], ImageDegradation(blur=0.8, noise=3.0, gain=0.8, gradient=0.4))
    picture = empty_board(BOARD, image, INTRINSICS.K, X_SC)
    assert picture is not None
    here = picture.sheet
    assert (picture.evidence[here] > 0.1).mean() < 0.01
    assert np.abs(picture.color[here] - srgb_to_linear(image)[here]).mean() < 6.0 / 255.0
    assert 0.4 < picture.blur < 1.2
    assert 1.5 < 255.0 * picture.noise < 6.0


def test_a_plate_that_is_not_there_is_not_found_in_its_neighbour() -> None:
    size, other = (0.12, 0.07), (0.38, 0.21, 0.3)
    there = aligner(drawing([cover(size, other, np.zeros(3))], ImageDegradation(noise=2.0)))
    found = locate_objects(there, {"here": plate(size, TARGET), "other": plate(size, other)})
    assert found["here"].alignment is None
    other_one = found["other"].alignment
    assert other_one is not None
    assert np.abs(other_one.q[:2]).max() < 5e-4


def test_black_photos_have_no_contrast() -> None:
    assert empty_board(BOARD, np.zeros((240, 320, 3), np.uint8), INTRINSICS.K, X_SC) is None
