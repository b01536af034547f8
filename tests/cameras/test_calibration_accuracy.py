"""The words in which a calibration says where the camera is known, of bounds that are given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from burg_drake.apps import print_intrinsics
from burg_drake.cameras import (
    IMAGE_PARTS,
    CalibrationAccuracy,
    Intrinsics,
    LensHypothesis,
    Promise,
    calibration_accuracy,
    is_useless,
)

CAMERA = Intrinsics(width=640, height=480, focal=(600.0, 600.0), center=(320.0, 240.0))
FISHEYE = replace(CAMERA, focal=(100.0, 100.0), model="fisheye", distortion=(0.0,) * 4)
CORNERS = [name for name in IMAGE_PARTS if "corner" in name]


SEEN = np.random.default_rng(0).uniform([250, 180], [390, 300], (50, 2))


def known(camera: Intrinsics, variance: float, corners: np.ndarray = SEEN) -> CalibrationAccuracy:
    """The accuracy of a camera whose parameters have some variance."""
    covariance = variance * np.eye(4 + len(camera.distortion))
    return calibration_accuracy(camera, (LensHypothesis(1.0, camera, covariance),), corners)


def accuracy(middle: float = 0.2, **others: float) -> CalibrationAccuracy:
    """Of the middle and, with `_` in their names, of other parts that are not as good."""
    bounds = {name: others.get(name.replace(" ", "_"), middle) for name in IMAGE_PARTS}
    return CalibrationAccuracy(bounds, 0.0)


def test_an_accuracy_holds_over_the_whole_image_or_says_where_not() -> None:
    assert str(accuracy(0.21)) == "known to 0.21 pixels over the whole image"
    but = accuracy(0.21, upper_edge=2.34, upper_left_corner=31.0)
    assert str(but) == (
        "known to 0.21 pixels, but for the upper left corner (more than 10), upper edge (2.3)"
    )
    assert but.excepted_parts == ("upper left corner", "upper edge") and but.error_bound == 0.21


def test_an_accuracy_that_holds_in_few_parts_begins_with_these() -> None:
    parts = dict.fromkeys(IMAGE_PARTS, 1.2) | {"middle": 0.24, "left edge": 0.3}
    assert str(CalibrationAccuracy(parts, 0.0)) == (
        "known in the left edge, middle only, to 0.30 pixels there, and not in the upper left"
        " corner (1.2), upper edge (1.2), upper right corner (1.2), right edge (1.2), lower left"
        " corner (1.2), lower edge (1.2), lower right corner (1.2)"
    )
    # Half of the nine parts are not yet most of them.
    assert str(CalibrationAccuracy(parts | dict.fromkeys(CORNERS, 0.4), 0.0)).startswith(
        "known to 0.40 pixels"
    )


def test_figures_that_tell_nothing_are_not_told(capsys: pytest.CaptureFixture[str]) -> None:
    nothing = "known no better than to 10 pixels"
    assert str(accuracy(187.81)) == str(accuracy(np.inf)) == str(accuracy(np.nan)) == nothing
    print_intrinsics(replace(CAMERA, known_to=187.81))
    assert "known            no better than to 10 pixels\n" in capsys.readouterr().out


def test_a_document_says_as_much(capsys: pytest.CaptureFixture[str]) -> None:
    for excepted, words in (
        ((), "to 0.24 pixels over the whole image"),
        (("upper edge",), "to 0.24 pixels, but for the upper edge"),
        ((*CORNERS, "upper edge"), "in the left edge, middle, right edge, lower edge only"),
        (
            tuple(name for name in IMAGE_PARTS if name != "middle"),
            "in the middle only, to 0.24 pixels",
        ),
    ):
        print_intrinsics(replace(CAMERA, known_to=0.24, except_at=excepted))
        assert f"known            {words}" in capsys.readouterr().out


def test_bounds_that_are_no_numbers_have_no_bound() -> None:
    found = known(CAMERA, np.nan)
    assert set(found.parts.values()) == {np.inf} and found.unknown == 1.0
    assert found.error_bound == np.inf and str(found) == "known no better than to 10 pixels"
    assert known(CAMERA, 1e-8).error_bound < 0.1


def test_parts_that_look_too_far_aside_have_no_bound() -> None:
    """100 pixels a radian: 85 degrees are 148 pixels from the middle, the image's corners 400."""
    found = known(FISHEYE, 1e-8)
    assert found.parts.keys() == {"middle"}
    assert set(CORNERS) < set(found.excepted_parts)
    assert "upper left corner (beyond 85 degrees)" in str(found)


def test_an_axis_far_outside_of_the_image_leaves_no_middle() -> None:
    seen = np.random.default_rng(0).uniform(0.0, 40.0, (50, 2))
    found = known(replace(FISHEYE, center=(-60.0, -60.0)), 1e-10, seen)
    assert found.parts.keys() == {"upper left corner"}
    assert "middle" in found.excepted_parts and found.error_bound < 0.1
    assert str(found).startswith("known in the upper left corner only")


class Calibrated:
    """As much of a calibration as `is_useless` asks for."""

    rms = 0.1

    def __init__(self, bounds: dict[str, float], unknown: float) -> None:
        self.accuracy = CalibrationAccuracy(bounds, unknown)


@pytest.mark.parametrize(
    ("elsewhere", "unknown", "useless"),
    [(0.2, 0.0, False), (1.2, 0.0, False), (9.0, 0.45, True), (0.2, 0.6, True)],
)
def test_a_camera_that_is_known_in_the_middle_only_is_of_little_use(
    elsewhere: float, unknown: float, useless: bool
) -> None:
    """The middle is half of the image: what is off by pixels around it counts by parts."""
    bounds = dict.fromkeys(IMAGE_PARTS, elsewhere) | {"middle": 0.2}
    assert is_useless(Calibrated(bounds, unknown)) is useless  # type: ignore[arg-type]


def test_deprecated_names_still_work() -> None:
    with pytest.warns(DeprecationWarning, match="Promise is CalibrationAccuracy since") as caught:
        made = Promise(dict.fromkeys(IMAGE_PARTS, 0.2), 0.0)
    assert isinstance(made, CalibrationAccuracy) and isinstance(accuracy(), Promise)
    assert caught[0].filename == __file__
    with pytest.warns(DeprecationWarning, match="known_to is error_bound since"):
        assert accuracy(0.21).known_to == 0.21
    with pytest.warns(DeprecationWarning, match="except_at is excepted_parts since"):
        assert accuracy(0.21).except_at == ()
