"""Poses from images with known truth, their covariance, and what is said about bad pictures."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from burg_drake.cameras import BoardEstimate, BoardPose, Intrinsics, estimate_board, perturbed_pose
from burg_drake.core import InvalidInputError
from burg_drake.scene import Board, Markers
from tests.cameras.board_views import CAMERA, SMALL, error, view
from tests.cameras.synthetic import (
    FINE,
    ImageDegradation,
    board_depth,
    board_image,
    covers_of,
    degraded,
    light_of,
)
from tests.thorough import thorough

BOARD = Board()
LITTLE = Board(size=(0.3, 0.21))  # 4 x 3 markers
VIEW = view((0.29, 0.2), 0.75, 25.0, 40.0, 15.0)
NEAR = view((0.15, 0.1), 0.4, 25.0, 200.0, 100.0)


@pytest.fixture(scope="module")
def poses() -> BoardPose:
    return BoardPose(BOARD, CAMERA)


@pytest.fixture(scope="module")
def clean() -> np.ndarray:
    return board_image(BOARD, CAMERA, VIEW, samples=FINE)


def near(estimate: BoardEstimate, truth: np.ndarray, mm: float, degrees: float) -> bool:
    off = error(estimate.X_SC, truth)
    return (
        estimate.valid
        and 1e3 * np.linalg.norm(off[3:]) < mm
        and np.degrees(np.linalg.norm(off[:3])) < degrees
    )


def test_a_clean_image_gives_the_pose_to_hundredths_of_a_millimetre(
    poses: BoardPose, clean: np.ndarray
) -> None:
    estimate = poses.estimate(clean)
    assert near(estimate, VIEW, 0.08, 0.008), 1e3 * error(estimate.X_SC, VIEW)
    assert estimate.reason == ""
    assert estimate.reprojection_error < 0.03
    assert len(estimate.ids) == 54
    p_C = (BOARD.layout.p_SQ - VIEW[:3, 3]) @ VIEW[:3, :3]
    assert np.abs(CAMERA.project(p_C) - estimate.corners).max() < 0.1
    assert np.isnan(estimate.scale)


def test_gray_rgb_and_rgba_are_the_same_picture(poses: BoardPose, clean: np.ndarray) -> None:
    alpha = np.full((*clean.shape[:2], 1), 255, np.uint8)
    X_SC = [poses.estimate(i).X_SC for i in (clean, np.concatenate([clean, alpha], axis=2))]
    assert np.array_equal(*X_SC)
    assert near(poses.estimate(clean[:, :, 1]), VIEW, 0.08, 0.008)


@pytest.mark.parametrize(("share", "mm", "degrees"), [thorough(0.55, 0.2, 0.016), (0.9, 0.8, 0.06)])
def test_hidden_markers_and_noise(
    poses: BoardPose, share: float, mm: float, degrees: float
) -> None:
    rng = np.random.default_rng(3)
    covers, seen = covers_of(BOARD.layout, share, rng)
    image = board_image(
        BOARD, CAMERA, VIEW, covers=covers, look=ImageDegradation(noise=4.0, blur=0.6), rng=rng
    )
    estimate = poses.estimate(image)
    assert near(estimate, VIEW, mm, degrees), 1e3 * error(estimate.X_SC, VIEW)
    assert set(estimate.ids) <= set(seen)


def test_partly_hidden_markers_that_no_detector_reads_take_part(poses: BoardPose) -> None:
    covers, seen = covers_of(BOARD.layout, 0.9, np.random.default_rng(5), partial=True)
    estimate = poses.estimate(board_image(BOARD, CAMERA, VIEW, covers=covers))
    assert len(estimate.ids) > 2 * len(seen)
    assert near(estimate, VIEW, 0.2, 0.016)


def test_a_lens_that_distorts() -> None:
    lens = replace(CAMERA, distortion=(0.12, -0.25, 0.001, -0.0015, 0.1))
    image = board_image(BOARD, lens, VIEW)
    assert near(estimate_board(image, lens, BOARD), VIEW, 0.1, 0.01)
    ignored = estimate_board(image, CAMERA, BOARD)
    assert not ignored.valid or "intrinsics" in ignored.reason
    assert not near(ignored, VIEW, 0.5, 0.05)


def test_the_covariance_is_that_of_the_errors() -> None:
    board_pose, rng = BoardPose(LITTLE, SMALL), np.random.default_rng(0)
    image = board_image(LITTLE, SMALL, NEAR, look=ImageDegradation(blur=0.6)).astype(float)
    normalised = []
    for _ in range(40):
        noisy = np.clip(np.rint(image + rng.normal(0.0, 8.0, image.shape)), 0, 255)
        estimate = board_pose.estimate(noisy.astype(np.uint8))
        off = error(estimate.X_SC, NEAR)
        normalised.append(off @ np.linalg.solve(estimate.covariance, off))
    # Chi-square of 6 degrees of freedom: the mean of 40 is 6 with a standard deviation of 0.55; the
    # covariance also has a share for errors that stay the same.
    assert 2.5 < np.mean(normalised) < 9.0


@pytest.mark.parametrize(
    ("gain", "blur", "mm", "degrees"), [(0.05, 0.6, 0.3, 0.025), (1.0, 1.5, 0.3, 0.025)]
)
def test_dark_and_blurred_pictures(
    poses: BoardPose, gain: float, blur: float, mm: float, degrees: float
) -> None:
    look, rng = ImageDegradation(gain=gain, blur=blur, noise=2.0), np.random.default_rng(1)
    estimate = poses.estimate(board_image(BOARD, CAMERA, VIEW, look=look, rng=rng))
    assert near(estimate, VIEW, mm, degrees)


@pytest.mark.parametrize(("gain", "mm"), [(1.4, 0.5), (2.0, 0.5)])
def test_paper_that_is_overexposed_is_no_other_board(
    poses: BoardPose, gain: float, mm: float
) -> None:
    look = ImageDegradation(gain=gain, blur=0.7)
    estimate = poses.estimate(board_image(BOARD, CAMERA, VIEW, look=look))
    assert near(estimate, VIEW, mm, 0.05)


@pytest.mark.parametrize("direction", [0.0, 30.0, thorough(90.0)])
def test_motion_while_the_camera_exposes(poses: BoardPose, direction: float) -> None:
    light = light_of(board_image(BOARD, CAMERA, VIEW))
    along = np.array([np.cos(np.deg2rad(direction)), np.sin(np.deg2rad(direction))])
    line = np.linspace(-2.0, 2.0, 17)[:, None] * along  # 4 pixels
    size = (CAMERA.width, CAMERA.height)
    moved = [
        cv2.warpAffine(light, np.c_[np.eye(2), by], size, flags=cv2.INTER_LINEAR) for by in line
    ]
    estimate = poses.estimate(degraded(np.mean(moved, axis=0), ImageDegradation()))
    assert near(estimate, VIEW, 0.3, 0.03)


def test_rows_exposed_one_after_the_other_are_told() -> None:
    board_pose = BoardPose(LITTLE, SMALL)
    turn = 2.0 / SMALL.focal[0] * np.array([0.5, -0.7, 0.3])  # about 2 pixels in all
    image, bands = board_image(LITTLE, SMALL, NEAR), 12
    for band in range(bands):
        rows = slice(band * SMALL.height // bands, (band + 1) * SMALL.height // bands)
        X_SC = perturbed_pose(NEAR, np.r_[turn * ((band + 0.5) / bands - 0.5), 0.0, 0.0, 0.0])
        image[rows] = board_image(LITTLE, SMALL, X_SC)[rows]
    estimate = board_pose.estimate(image)
    assert estimate.valid and "during its rolling shutter" in estimate.reason
    off = error(estimate.X_SC, NEAR)
    assert np.sqrt(off @ np.linalg.solve(estimate.covariance, off) / 6.0) < 3.0
    # Corners are told where they are seen, not where a camera at rest would have them.
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_ARUCO_MIP_36h12)
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    found, ids, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(image)
    seen = {int(i): c.reshape(4, 2) for i, c in zip(ids.ravel(), found, strict=True)}
    apart = [estimate.corners[k] - seen[i] for k, i in enumerate(estimate.ids) if i in seen]
    assert len(apart) > 6
    assert np.sqrt((np.mean(apart, axis=1) ** 2).mean()) < 0.12
    assert estimate.reprojection_error > 0.2


def test_markers_that_are_a_little_too_large_leave_the_scale_uncertain() -> None:
    side = LITTLE.markers.side
    larger = Markers(side=1.013 * side, spacing=LITTLE.markers.spacing - 0.013 * side)
    image = board_image(replace(LITTLE, markers=larger), SMALL, NEAR)
    estimate = estimate_board(image, SMALL, LITTLE)
    assert estimate.valid
    assert estimate.reason.startswith("the scale is uncertain: markers look 1.01")


def test_errors_in_strongly_blurred_pictures_are_what_the_covariance_says() -> None:
    board_pose, rng = BoardPose(LITTLE, SMALL), np.random.default_rng(0)
    normalised = []
    for roll in (0.0, 100.0, 230.0):
        truth = view((0.15, 0.1), 0.4, 25.0, 200.0, roll)
        image = board_image(LITTLE, SMALL, truth, look=ImageDegradation(blur=2.0)).astype(float)
        for _ in range(10):
            noisy = np.clip(np.rint(image + rng.normal(0.0, 4.0, image.shape)), 0, 255)
            estimate = board_pose.estimate(noisy.astype(np.uint8))
            off = error(estimate.X_SC, truth)
            normalised.append(off @ np.linalg.solve(estimate.covariance, off))
    assert 1.5 < np.mean(normalised) < 15.0  # 6 if right


def test_the_same_picture_gives_the_same_bits_whatever_came_before(
    poses: BoardPose, clean: np.ndarray
) -> None:
    first = poses.estimate(clean)
    poses.estimate(np.ascontiguousarray(clean[::-1]))
    again = poses.estimate(clean.copy())
    fresh = BoardPose(BOARD, CAMERA).estimate(clean)
    for other in (again, fresh):
        assert np.array_equal(first.X_SC, other.X_SC)
        assert np.array_equal(first.covariance, other.covariance)
        assert first.ids == other.ids


def test_unread_markers_take_part_though_some_were_read_that_suffice(
    poses: BoardPose, clean: np.ndarray
) -> None:
    # Bars across all but one corner of the board's markers: no detector reads these.
    barred = clean.copy()
    read = np.zeros(54, dtype=bool)
    read[[0, 1, 2, 3, 9, 10, 11, 12, 18, 19, 20, 21]] = True
    p_C = (BOARD.layout.p_SQ[~read].mean(axis=1) - VIEW[:3, 3]) @ VIEW[:3, :3]
    for u, v in CAMERA.project(p_C):
        cv2.circle(barred, (round(u), round(v)), 9, (70, 96, 120), -1)
    estimate = poses.estimate(barred)
    assert len(estimate.ids) > 40
    assert near(estimate, VIEW, 0.1, 0.01)


def test_nothing_in_sight(poses: BoardPose) -> None:
    estimate = poses.estimate(np.full((480, 640, 3), 128, np.uint8))
    assert not estimate.valid
    assert np.isnan(estimate.X_SC).all()
    assert estimate.reason == "no marker of the board in sight"


@pytest.mark.parametrize(
    ("markers", "reason"),
    [
        (
            Markers(dictionary="4X4_250", side=0.057, spacing=0.019),
            "another board: 5 markers of 4X4_250 in sight, but this one has ARUCO_MIP_36h12",
        ),
        (
            Markers(first_id=100),
            "another board: 10 markers of ARUCO_MIP_36h12 with ids 100, 101, 102 ... in sight, but"
            " this one has 0 to 11; is first_id right?",
        ),
        (
            Markers(side=0.044, spacing=0.017),
            "another board: its markers are 0.96 times as large, relative to their spacing, as"
            " those of this one (side 45 mm, spacing 15 mm)",
        ),
        (
            Markers(count=(3, 3)),
            "another board: only 0 of 9 markers in sight are where this one has them; are"
            " columns, rows and first_id right?",
        ),
    ],
)
def test_another_board(markers: Markers, reason: str) -> None:
    image = board_image(replace(LITTLE, markers=markers), SMALL, NEAR)
    estimate = estimate_board(image, SMALL, LITTLE)
    assert not estimate.valid
    assert estimate.reason == reason


def test_much_smaller_markers_at_the_same_distances() -> None:
    board = replace(LITTLE, markers=Markers(side=0.03, spacing=0.03, count=(4, 3)))
    reason = estimate_board(board_image(board, SMALL, NEAR), SMALL, LITTLE).reason
    assert reason.startswith("another board: its markers are 0.6")


def test_the_size_of_the_print_by_depth_and_by_a_known_place() -> None:
    image = board_image(LITTLE, SMALL, NEAR, scale=(0.97, 0.97))
    for known in ({"depth": board_depth(SMALL, NEAR)}, {"X_SC_known": NEAR}):
        estimate = estimate_board(image, SMALL, LITTLE, **known)
        assert estimate.scale == pytest.approx(0.97, abs=0.001)
        assert estimate.reason == (
            "the board is printed at 0.97 of its size: print it at 100 %, or give the measured"
            " lengths of its rulers"
        )
        # The pose is 3 % of the distance off, though the residuals are small.
        assert not estimate.valid and np.isnan(estimate.X_SC).all()
    assert estimate_board(image, SMALL, LITTLE).reason == ""  # an image alone does not show it
    measured = BoardPose(LITTLE, SMALL, (0.97, 0.97)).estimate(image, X_SC_known=NEAR)
    assert measured.scale == pytest.approx(1.0, abs=0.001)
    assert measured.reason == ""
    assert near(measured, NEAR, 0.1, 0.02)


def test_a_print_that_is_longer_along_one_axis() -> None:
    image = board_image(LITTLE, SMALL, NEAR, scale=(1.0, 1.012))
    estimate = estimate_board(image, SMALL, LITTLE)
    assert estimate.valid
    assert estimate.reason == (
        "the board is printed 1.012 times as long along y as along x: measure its rulers and print"
        " it again with the measured lengths, or check the intrinsics"
    )
    measured = BoardPose(LITTLE, SMALL, (1.0, 1.012)).estimate(image)
    assert measured.reason == ""
    assert near(measured, NEAR, 0.1, 0.02)


def test_one_small_marker_has_two_poses() -> None:
    board = Board(size=(0.1, 0.1), markers=Markers(count=(1, 1), side=0.03))
    far = view((0.05, 0.05), 0.8, 5.0, 30.0, 10.0)
    rng = np.random.default_rng(0)
    image = board_image(board, CAMERA, far, look=ImageDegradation(noise=10.0, blur=0.8), rng=rng)
    estimate = estimate_board(image, CAMERA, board)
    assert not estimate.valid
    assert estimate.reason == (
        "1 marker in sight: two poses fit equally well; move closer or show more of the board"
    )
    close = view((0.05, 0.05), 0.12, 35.0, 30.0, 10.0)
    assert near(estimate_board(board_image(board, CAMERA, close), CAMERA, board), close, 0.2, 0.1)


def test_pictures_that_are_none_of_this_camera(poses: BoardPose) -> None:
    with pytest.raises(InvalidInputError, match="the image has 320 x 240"):
        poses.estimate(np.zeros((240, 320, 3), np.uint8))
    with pytest.raises(InvalidInputError, match="2 channels; expected 3 or 4"):
        poses.estimate(np.zeros((480, 640, 2), np.uint8))
    with pytest.raises(InvalidInputError, match=r"shape \(480, 640, 3\) and type float64"):
        poses.estimate(np.zeros((480, 640, 3)))
    with pytest.raises(InvalidInputError, match="the depth image has shape"):
        poses.estimate(np.zeros((480, 640, 3), np.uint8), depth=np.zeros((240, 320), np.float32))
    with pytest.raises(InvalidInputError, match="must be positive"):
        BoardPose(BOARD, CAMERA, (1.0, 0.0))


def test_intrinsics_of_another_camera_are_doubtful(clean: np.ndarray) -> None:
    wrong = Intrinsics(width=640, height=480, focal=(600.0, 660.0), center=(360.0, 200.0))
    estimate = estimate_board(clean, wrong, BOARD)
    assert not estimate.valid or "intrinsics" in estimate.reason


@pytest.mark.parametrize("scale", [(0.99, 1.0), (1.0, 0.995)])
def test_a_print_longer_along_one_axis_leaves_its_size_open(scale: tuple[float, float]) -> None:
    X_SC = view((0.29, 0.2), 0.7, 30.0, 40.0, 10.0)
    estimate = BoardPose(Board(), CAMERA).estimate(board_image(Board(), CAMERA, X_SC, scale=scale))
    assert estimate.valid
    assert "times as long along y as along x" in estimate.reason
    # The camera's height over the sheet is off by what one axis is, and S by what its middle is.
    off = error(estimate.X_SC, X_SC)[3:]
    assert np.sqrt(off @ np.linalg.solve(estimate.covariance[3:, 3:], off) / 3.0) < 1.5
    assert np.linalg.norm(off) > 1e-3


def test_edges_that_a_longer_axis_moves_most_count_too() -> None:
    """In noise they look like outliers of a pose that does not know of it: 1.004, 0.06 degrees."""
    X_SC = view((0.29, 0.2), 0.7, 45.0, 80.0, 10.0)
    look = ImageDegradation(blur=0.7, noise=2.0)
    rng = np.random.default_rng(0)
    image = board_image(Board(), CAMERA, X_SC, scale=(0.995, 1.0), look=look, rng=rng)
    estimate = BoardPose(Board(), CAMERA).estimate(image)
    assert estimate.valid and "1.005 times as long along y as along x" in estimate.reason
    off = error(estimate.X_SC, X_SC)
    assert np.rad2deg(np.linalg.norm(off[:3])) < 0.02
    assert np.sqrt(off @ np.linalg.solve(estimate.covariance, off) / 6.0) < 1.3


def test_what_intrinsics_are_known_to_is_in_the_covariance() -> None:
    X_SC = view((0.29, 0.2), 0.7, 20.0, 40.0, 10.0)
    image = board_image(Board(), CAMERA, X_SC)
    shifted = (CAMERA.center[0] + 0.3, CAMERA.center[1] - 0.4)
    known = replace(CAMERA, center=shifted, known_to=0.5)
    plain = BoardPose(Board(), replace(known, known_to=None)).estimate(image)
    estimate = BoardPose(Board(), known).estimate(image)
    assert np.array_equal(estimate.X_SC, plain.X_SC)
    sigmas = []
    for found in (plain, estimate):
        off = error(found.X_SC, X_SC)
        sigmas.append(np.sqrt(off @ np.linalg.solve(found.covariance, off) / 6.0))
    assert sigmas[0] > 5.0 and sigmas[1] < 1.5


def test_a_curled_strip_that_lies_a_pixel_beside_its_place_counts() -> None:
    """All edges of its markers dropped out as outliers: 0.7 mm off, 2.2 standard deviations."""
    X_SC = view((0.33, 0.19), 0.67, 34.0, 22.0, -80.0)

    def rise(p: np.ndarray) -> np.ndarray:
        return 6e-3 * (1.0 - np.clip(p[..., 0] / 0.15, 0.0, 1.0)) ** 2

    # S is the plane that fits the markers' corners best.
    corners = Board().layout.p_SQ.reshape(-1, 3)
    terms = np.column_stack([np.ones(len(corners)), corners[:, :2]])
    plane = np.linalg.lstsq(terms, rise(corners), rcond=None)[0]
    flat = board_image(Board(), CAMERA, X_SC, look=ImageDegradation(blur=0.6))
    u, v = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    slopes = (np.dstack([u, v]) - CAMERA.center) / CAMERA.focal
    rays = np.dstack([slopes, np.ones(u.shape)]) @ X_SC[:3, :3].T
    p = np.zeros(rays.shape)
    for _ in range(8):  # where rays meet the sheet
        z = rise(p) - plane[0] - p[..., :2] @ plane[1:]
        p = X_SC[:3, 3] + rays * ((z - X_SC[2, 3]) / rays[..., 2])[..., None]
    # What a flat sheet shows there.
    p_C = (p * [1.0, 1.0, 0.0] - X_SC[:3, 3]) @ X_SC[:3, :3]
    at = CAMERA.project(p_C.reshape(-1, 3)).reshape(*u.shape, 2).astype(np.float32)
    image = cv2.remap(flat, at, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    estimate = BoardPose(Board(), CAMERA).estimate(image)
    assert near(estimate, X_SC, 0.3, 0.02) and "out of its plane" in estimate.reason
    off = error(estimate.X_SC, X_SC)
    assert np.sqrt(off @ np.linalg.solve(estimate.covariance, off) / 6.0) < 1.3


def test_half_of_a_sheet_that_is_glued_four_millimetres_aside_still_counts() -> None:
    # A gap between markers is at the image's middle, where the pages meet.
    gap = float(Board().layout.p_SQ[4, 1, 0]) + 0.0075
    X_SC = view((gap, 0.21), 0.55, 0.0, 0.0, 0.0)
    halves = []
    for aside in (-2e-3, 2e-3):
        moved = X_SC.copy()
        moved[0, 3] -= aside  # the sheet moves the other way than the camera
        halves.append(board_image(Board(), CAMERA, moved))
    cut = round(float(CAMERA.center[0]))
    side_by_side = np.hstack([halves[0][:, :cut], halves[1][:, cut:]])
    estimate = BoardPose(Board(), CAMERA).estimate(side_by_side)
    assert estimate.valid and "from their positions in the plane" in estimate.reason
    whole = BoardPose(Board(), CAMERA).estimate(board_image(Board(), CAMERA, X_SC))
    assert len(set(whole.ids) - set(estimate.ids)) < 3  # at the rim
    truth = X_SC.copy()
    truth[0, 3] += (
        1e-3 / 9.0
    )  # S fits all of the sheet: five columns left and four right of the gap
    off = error(estimate.X_SC, truth)
    assert np.sqrt(off @ np.linalg.solve(estimate.covariance, off) / 6.0) < 3.0
