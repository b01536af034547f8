"""The calibration target: in OpenCV's own drawing, in images, and on paper."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from burg_drake.cameras import (
    CharucoTarget,
    CharucoView,
    Image,
    Intrinsics,
    find_target,
    target_origin,
    write_target,
)
from burg_drake.core import Array, BurgError, InvalidInputError, make_pose
from burg_drake.printout import PrintSettings
from tests.cameras.charuco_image import target_image
from tests.cameras.synthetic import levels, light_of
from tests.printout.paper import rasterised

TARGET = CharucoTarget()
CAMERA = Intrinsics(
    width=360,
    height=270,
    focal=(400.0, 402.0),
    center=(182.0, 132.0),
    distortion=(-0.2, 0.05, 0.0, 0.0),
)
DENSE = 12
"""Pixels a millimetre of OpenCV's drawing of a board."""


def looking(distance: float = 0.3, tilt: float = 0.4, roll: float = 0.3) -> Array:
    """X_TC of a camera that looks at the middle of the target."""
    R = cv2.Rodrigues(np.array([tilt, 0.5 * tilt, 0.0]))[0]
    R = R @ cv2.Rodrigues(np.array([0.0, 0.0, roll]))[0]
    center = np.array([*TARGET.size, 0.0]) / 2.0
    return make_pose(R, center - R @ [0.0, 0.0, distance])


def expected(view: CharucoView, X_TC: Array, target: CharucoTarget = TARGET) -> Array:
    X_CT = np.linalg.inv(X_TC)
    return CAMERA.project(target.p_TQ[view.ids] @ X_CT[:3, :3].T + X_CT[:3, 3])


def drawing(target: CharucoTarget, per_mm: int = DENSE) -> np.ndarray:
    """OpenCV's drawing of the board, without any white around."""
    size = [round(1e3 * side * per_mm) for side in target.size]
    return np.asarray(target.board.generateImage(size, marginSize=0))


def test_corners_of_a_synthetic_image_are_found() -> None:
    rng = np.random.default_rng(0)
    view = find_target(
        target_image(TARGET, CAMERA, looking(), blur=0.7, noise=2.0, rng=rng), TARGET
    )
    assert isinstance(view, CharucoView)
    assert len(view.ids) > 50 and view.size == (360, 270)
    off = np.linalg.norm(view.corners - expected(view, looking()), axis=1)
    assert np.sqrt(np.mean(off**2)) < 0.04 and off.max() < 0.15
    assert 24.0 < view.side < 32.0


@pytest.fixture(scope="module")
def sharp() -> Image:
    """A straight view from near by."""
    return target_image(TARGET, CAMERA, looking(0.13, 0.0, 0.0))


def levels_of(light: np.ndarray) -> Image:
    return np.rint(levels(light)).astype(np.uint8)


@pytest.mark.parametrize("blur", [1.0, 1.5, 2.0])
def test_blur_is_measured(sharp: Image, blur: float) -> None:
    view = find_target(levels_of(cv2.GaussianBlur(light_of(sharp), (0, 0), blur)), TARGET)
    assert isinstance(view, CharucoView)
    # A pixel's own width counts, too: its variance is 1/12.
    assert view.blur == pytest.approx(np.sqrt(blur**2 + 1 / 12), rel=0.15)


def test_motion_blurs_edges_of_one_direction(sharp: Image) -> None:
    moved = find_target(levels_of(cv2.blur(light_of(sharp), (7, 1))), TARGET)
    assert isinstance(moved, CharucoView) and moved.blur > 1.8


@pytest.mark.parametrize(("squares", "legacy"), [((5, 7), False), ((6, 8), True)])
def test_synthetic_images_show_what_opencv_draws(squares: tuple[int, int], legacy: bool) -> None:
    """OpenCV's drawing, warped by the homography of a pinhole camera, against ours."""
    target = CharucoTarget(squares=squares, legacy=legacy)
    camera = replace(CAMERA, distortion=())
    X_TC = looking(0.35)
    X_CT = np.linalg.inv(X_TC)
    fine = 4  # rays a pixel
    K = camera.K.copy()
    K[:2] *= fine
    K[:2, 2] += 0.5 * (fine - 1)
    to_metres = np.diag([1e-3 / DENSE, 1e-3 / DENSE, 1.0])
    to_metres[:2, 2] = 0.5e-3 / DENSE
    H = K @ np.column_stack([X_CT[:3, 0], X_CT[:3, 1], X_CT[:3, 3]]) @ to_metres
    small = cv2.blur(drawing(target), (5, 5))
    warped = cv2.warpPerspective(small, H, (360 * fine, 270 * fine), borderValue=255)
    theirs = cv2.resize(warped, (360, 270), interpolation=cv2.INTER_AREA).astype(float)
    ours = light_of(cv2.cvtColor(target_image(target, camera, X_TC), cv2.COLOR_RGB2GRAY))
    on_board = cv2.warpPerspective(
        np.full_like(small, 255), H, (360 * fine, 270 * fine), borderValue=0
    )
    inside = cv2.resize(on_board, (360, 270), interpolation=cv2.INTER_AREA) == 255
    line = np.polyfit(theirs[inside], ours[inside], 1)
    assert np.abs(np.polyval(line, theirs) - ours)[inside].mean() < 0.012
    assert np.corrcoef(theirs[inside], ours[inside])[0, 1] > 0.998


def test_reasons_why_there_is_no_view(sharp: Image) -> None:
    rng = np.random.default_rng(0)
    blank = np.full((270, 360, 3), 128, dtype=np.uint8)
    assert find_target(blank, TARGET) == "does not show the target"
    noise = rng.integers(0, 255, (270, 360), dtype=np.uint8)
    assert find_target(noise, TARGET) == "does not show the target"
    other = CharucoTarget(dictionary="4X4_100")
    assert find_target(sharp, other) == "does not show the target"
    column = np.full_like(sharp, 128)
    column[:, 150:280] = sharp[:, 150:280]  # two squares wide
    assert "of the target" in str(find_target(column, TARGET))
    wide = CharucoTarget(marker=0.018)
    close = target_image(wide, CAMERA, looking(0.3, 0.2))
    assert "shows the target too small: its squares are 2" in str(find_target(close, wide))


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ({"squares": (2, 9)}, "2 x 9 squares is too small; give at least 3 x 3"),
        ({"marker": 0.02}, "markers of 20 mm do not fit into squares of 20 mm"),
        ({"squares": (20, 20)}, "needs 200 markers, but 5X5_100 has 100"),
        ({"dictionary": "5X5_10"}, "marker dictionary '5X5_10' does not exist"),
    ],
)
def test_targets_that_cannot_be(target: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        CharucoTarget(**target)  # type: ignore[arg-type]


# --- on paper --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("target", "settings"),
    [
        (TARGET, PrintSettings()),
        (CharucoTarget(squares=(6, 8), legacy=True), PrintSettings(page="letter")),
        (
            CharucoTarget(squares=(11, 6), dictionary="ARUCO_MIP_36h12"),
            PrintSettings(measured=(0.099, 0.101)),
        ),
    ],
)
def test_the_printed_target_has_its_true_size(
    tmp_path: Path, target: CharucoTarget, settings: PrintSettings
) -> None:
    """Marker corners on the page, found by OpenCV, are those of the board in millimetres."""
    paper = write_target(target, tmp_path / "target.pdf", settings)
    (page,) = rasterised((tmp_path / "target.pdf").read_bytes(), 300)
    view = find_target(page, target)
    assert isinstance(view, CharucoView)
    assert len(view.ids) == len(target.p_TQ)  # every corner, so every marker too
    per_metre = 300 / 0.0254
    stretch = 0.1 / np.array(settings.measured)
    place = target_origin(target, paper)[None] + target.p_TQ[view.ids, :2] * [1.0, -1.0]
    found = (view.corners + 0.5) / per_metre * [1.0, -1.0] + [0.0, len(page) / per_metre]
    assert np.abs(found / stretch - place).max() < 0.06e-3
    sizes = np.ptp(found / stretch, axis=0) - np.ptp(target.p_TQ[:, :2], axis=0)
    assert np.abs(sizes).max() < 0.03e-3


def test_a_target_that_does_not_fit_on_the_page(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError) as raised:
        write_target(CharucoTarget(square=0.03, marker=0.02), tmp_path / "a.pdf")
    assert "240 x 330 mm, but page A4 has room" in str(raised.value)
    assert not (tmp_path / "a.pdf").exists()
    with pytest.raises(BurgError, match="page 'A9' does not exist"):
        write_target(TARGET, tmp_path / "a.pdf", PrintSettings(page="A9"))
