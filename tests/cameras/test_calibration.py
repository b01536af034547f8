"""Calibration from corners with known truth; images are in `test_charuco` and the app's tests."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from burg_drake.cameras import (
    CharucoTarget,
    CharucoView,
    Frame,
    Intrinsics,
    LensHypothesis,
    ViewCollector,
    calibrate,
    calibrate_views,
    calibration_advice,
    camera_covariance,
    camera_error,
    corner_coverage,
    corner_displacement,
    fit_lens,
    guess_camera,
    image_grid,
    is_useless,
    wanted_views,
)
from burg_drake.core import Array, InvalidInputError, UnknownNameError, make_pose
from tests.cameras.charuco_image import target_image

TARGET = CharucoTarget()
PINHOLE = Intrinsics(width=640, height=480, focal=(600.0, 604.0), center=(325.0, 236.0))
LENSES = {
    "pinhole": PINHOLE,
    "radial4": replace(PINHOLE, distortion=(-0.25, 0.08, 0.001, -0.0005)),
    "radial": replace(PINHOLE, distortion=(0.12, -0.25, 0.0004, 0.0008, 0.4)),
    "rational": replace(PINHOLE, distortion=(0.4, 0.05, 0.0002, -0.0003, 0.002, 0.9, 0.1, 0.005)),
    "fisheye": replace(
        PINHOLE, focal=(260.0, 261.0), model="fisheye", distortion=(0.03, -0.02, 0.006, -0.001)
    ),
}


def looking(rng: np.random.Generator, tilt: float = 0.7) -> Array:
    """X_TC of a camera anywhere over the target."""
    axis = rng.normal(size=2)
    turn = np.array([*(axis / np.linalg.norm(axis) * rng.uniform(0.2, 1.0) * tilt), 0.0])
    R = cv2.Rodrigues(turn)[0] @ cv2.Rodrigues(np.array([0.0, 0.0, rng.uniform(0.0, 6.0)]))[0]
    distance = rng.uniform(0.2, 0.4)
    aside = rng.uniform(-0.3, 0.3, 2) * distance
    return make_pose(R, np.array([*TARGET.size, 0.0]) / 2.0 - R @ [*aside, distance])


def seen(
    intrinsics: Intrinsics, X_TC: Array, noise: float, rng: np.random.Generator, name: str = "view"
) -> CharucoView:
    """Corners where the camera sees them, without any image."""
    X_CT = np.linalg.inv(X_TC)
    pixels = intrinsics.project(TARGET.p_TQ @ X_CT[:3, :3].T + X_CT[:3, 3])
    size = (intrinsics.width, intrinsics.height)
    inside = ((pixels > 5) & (pixels < np.array(size) - 5)).all(axis=1)
    corners = pixels[inside] + rng.normal(0.0, noise, (inside.sum(), 2))
    return CharucoView(name, size, np.flatnonzero(inside).astype(np.int32), corners, 0.8, 40.0)


def views_of(
    intrinsics: Intrinsics, count: int, noise: float, seed: int = 0, tilt: float = 0.7
) -> list[CharucoView]:
    rng = np.random.default_rng(seed)
    views: list[CharucoView] = []
    while len(views) < count:
        view = seen(intrinsics, looking(rng, tilt), noise, rng, f"view {len(views)}")
        if len(view.ids) > 20:
            views.append(view)
    return views


def largest_deviation(
    truth: Intrinsics, found: Intrinsics, views: list[CharucoView] | None = None
) -> float:
    """Between where both show the same, over the image, or where views saw corners [pixels]."""
    pixels = image_grid(truth) if views is None else np.concatenate([v.corners for v in views])
    return float(np.linalg.norm(found.project(truth.rays(pixels)) - pixels, axis=1).max())


@pytest.mark.parametrize("model", LENSES)
def test_exact_corners_give_the_exact_camera(model: str) -> None:
    views = views_of(LENSES[model], 12, 0.0)
    found = calibrate_views(views, TARGET, model=model)
    seen_to = LENSES[model].rays(np.concatenate([view.corners for view in views]))[:, 2].min()
    pixels = image_grid(LENSES[model])
    rays = LENSES[model].rays(pixels)
    off = np.linalg.norm(found.intrinsics.project(rays) - pixels, axis=1)
    assert off[rays[:, 2] > seen_to].max() < (4e-3 if model == "rational" else 2e-3)
    # Farther off the axis than any corner: these views end at 41 degrees of a fisheye's 89, and
    # what they tell least of a rational lens is held by the prior.
    most = {"fisheye": 2.0, "rational": 0.07}.get(model, 2e-3)
    assert off.max() < most
    assert found.rms < 1e-3 and not found.rejected and found.model == model
    assert found.intrinsics.residual == found.rms


@pytest.mark.parametrize("model", ["radial4", "radial", "rational", "fisheye"])
def test_the_lens_model_is_the_one_that_the_corners_support(model: str) -> None:
    views = views_of(LENSES[model], 25, 0.05, seed=1)
    found = calibrate_views(views, TARGET)
    assert found.model == model
    assert largest_deviation(LENSES[model], found.intrinsics, views) < 0.3
    # Uniform over x and y: root mean square of the length is sqrt(2) times the noise.
    assert found.rms == pytest.approx(0.05 * np.sqrt(2.0), rel=0.05)


@pytest.mark.parametrize("model", ["radial4", "radial", "rational"])
def test_standard_deviations_are_those_of_opencv(model: str) -> None:
    views = views_of(LENSES[model], 12, 0.1)
    fit = fit_lens(views, TARGET, model, guess_camera(views, TARGET, "perspective"), bend=0.0)
    flags = {"radial4": cv2.CALIB_FIX_K3, "radial": 0, "rational": cv2.CALIB_RATIONAL_MODEL}[model]
    guess = fit.intrinsics
    k = np.array([*guess.distortion, 0.0])[: max(5, len(guess.distortion))]
    _, K, k, _, _, deviations, _, _ = cv2.calibrateCameraExtended(
        [TARGET.p_TQ[v.ids].astype(np.float32) for v in views],
        [v.corners.astype(np.float32) for v in views],
        (640, 480),
        guess.K.copy(),
        k,
        flags=flags | cv2.CALIB_USE_INTRINSIC_GUESS,
    )
    ours = np.sqrt(np.diag(camera_covariance(fit)))
    # Some combinations of rational coefficients are held by the prior, which OpenCV does not have.
    compared = [0, 1, 2, 3, 6, 7] if model == "rational" else list(range(len(ours)))
    assert np.allclose(ours[compared], np.ravel(deviations)[compared], rtol=5e-3)
    theirs = replace(guess, focal=(K[0, 0], K[1, 1]), center=(K[0, 2], K[1, 2]))
    theirs = replace(theirs, distortion=tuple(np.ravel(k)[: len(guess.distortion)].tolist()))
    assert largest_deviation(theirs, guess, views) < 0.02


def test_a_fisheye_fit_is_that_of_opencv() -> None:
    views = views_of(LENSES["fisheye"], 12, 0.1)
    fit = fit_lens(views, TARGET, "fisheye", guess_camera(views, TARGET, "fisheye"), bend=0.0)
    k = np.array(fit.intrinsics.distortion)
    names = cv2.fisheye if hasattr(cv2.fisheye, "CALIB_FIX_SKEW") else cv2  # OpenCV 4, OpenCV 5
    flags = names.CALIB_USE_INTRINSIC_GUESS | names.CALIB_FIX_SKEW | names.CALIB_RECOMPUTE_EXTRINSIC
    _, K, k, _, _ = cv2.fisheye.calibrate(
        [TARGET.p_TQ[v.ids][None] for v in views],
        [v.corners[None] for v in views],
        (640, 480),
        fit.intrinsics.K.copy(),
        k,
        flags=flags,
    )
    theirs = replace(
        fit.intrinsics,
        focal=(K[0, 0], K[1, 1]),
        center=(K[0, 2], K[1, 2]),
        distortion=tuple(np.ravel(k).tolist()),
    )
    assert largest_deviation(theirs, fit.intrinsics, views) < 0.01


def test_uncertainty_is_the_scatter_of_many_calibrations() -> None:
    """Monte Carlo: the same views with other noise, over and over."""
    truth, pixels = LENSES["radial4"], image_grid(PINHOLE, 5, 4)
    exact = views_of(truth, 8, 0.0)
    start = guess_camera(exact, TARGET, "perspective")
    seen = np.concatenate([view.corners for view in exact])
    rays, seen_rays = truth.rays(pixels), truth.rays(seen)
    rng = np.random.default_rng(1)
    off, expected = [], []
    for _ in range(40):
        noisy = [
            replace(v, corners=v.corners + rng.normal(0.0, 0.2, v.corners.shape)) for v in exact
        ]
        fit = fit_lens(noisy, TARGET, "radial4", start)
        found = fit.intrinsics
        # The turn of the camera that explains most of the difference where corners were seen.
        step = 1e-6
        by_turn = [
            (truth.project(seen_rays @ cv2.Rodrigues(step * axis)[0].T) - seen).ravel() / step
            for axis in np.eye(3)
        ]
        difference = (found.project(seen_rays) - seen).ravel()
        turn = np.linalg.lstsq(np.transpose(by_turn), difference, rcond=None)[0]
        R = cv2.Rodrigues(-turn)[0]
        off.append(np.linalg.norm(found.project(rays @ R.T) - pixels, axis=1))
        alone = LensHypothesis(1.0, found, camera_covariance(fit))
        expected.append(camera_error(found, (alone,), seen, pixels))
    scatter = np.sqrt(np.mean(np.square(off), axis=0))
    assert np.allclose(scatter, np.mean(expected, axis=0), rtol=0.4)
    assert scatter.mean() == pytest.approx(np.mean(expected), rel=0.2)


def test_views_that_do_not_count_are_left_out_with_the_reason() -> None:
    views = views_of(LENSES["radial4"], 15, 0.05)
    rng = np.random.default_rng(5)
    zoomed = replace(PINHOLE, focal=(800.0, 804.0))
    blurred = replace(seen(PINHOLE, looking(rng), 0.0, rng, "blurred"), blur=6.0)
    large = replace(views[3], name="large", size=(1280, 960), corners=2.0 * views[3].corners)
    twin = replace(views[4], name="twin", corners=views[4].corners + 0.5)
    bent = replace(views[5], name="bent", corners=views[5].corners[::-1] * [1.0, 0.97])
    others = [bent, large, blurred, twin, seen(zoomed, looking(rng), 0.0, rng, "zoomed")]
    found = calibrate_views([*views, *others], TARGET, rejected=[("blank", "shows nothing")])
    reasons = dict(found.rejected)
    assert set(reasons) == {"blank", "bent", "large", "blurred", "twin", "zoomed"}
    assert reasons["blank"] == "shows nothing"
    assert reasons["large"] == "has 1280 x 960 pixels, the others have 640 x 480"
    assert reasons["blurred"] == "is blurred: its edges are 6.0 pixels wide"
    assert reasons["twin"] == "shows the target in the same place as view 4"
    assert "pixels off, the median" in reasons["zoomed"] and "pixels off" in reasons["bent"]
    assert largest_deviation(LENSES["radial4"], found.intrinsics) < 0.5
    assert [used.view.name for used in found.views] == [view.name for view in views]


def test_wrong_corners_are_left_out_without_their_view() -> None:
    views = views_of(LENSES["radial4"], 15, 0.05)
    corners = views[2].corners.copy()
    corners[[1, 7]] += [[6.0, -3.0], [0.0, 4.0]]
    views[2] = replace(views[2], corners=corners)
    found = calibrate_views(views, TARGET)
    assert not found.rejected
    assert set(views[2].ids) - set(found.views[2].view.ids) == set(views[2].ids[[1, 7]])
    assert largest_deviation(LENSES["radial4"], found.intrinsics) < 0.5


def test_too_few_views_are_refused() -> None:
    views = views_of(PINHOLE, 2, 0.0)
    with pytest.raises(InvalidInputError) as raised:
        calibrate_views(views, TARGET, rejected=[("a.png", "does not show the target")])
    assert str(raised.value) == (
        "2 of 3 images can be used; a calibration needs at least 3, better 15; a.png"
        " does not show the target"
    )
    with pytest.raises(InvalidInputError, match="0 of 1 images can be used"):
        calibrate([np.zeros((48, 64, 3), dtype=np.uint8)], TARGET)
    with pytest.raises(UnknownNameError, match="lens model 'radial5' does not exist"):
        calibrate_views(views, TARGET, model="radial5")


@pytest.mark.thorough
def test_views_without_tilt_are_known_to_tell_little() -> None:
    straight = calibrate_views(views_of(LENSES["radial4"], 12, 0.1, tilt=0.02), TARGET)
    tilted = calibrate_views(views_of(LENSES["radial4"], 15, 0.1), TARGET)
    sides = "tilt the target by 20 to 45 degrees, so that it faces left, then right, then up, then"
    assert any(line.startswith(sides) for line in calibration_advice(straight))
    assert straight.parameters["fx"][1] > 20 * tilted.parameters["fx"][1]
    assert is_useless(straight) and not is_useless(tilted)
    assert not any(line.startswith(sides) for line in calibration_advice(tilted))


def test_advice_names_what_was_not_seen() -> None:
    views = views_of(LENSES["radial4"], 25, 0.05)
    kept = []
    for view in views[:16]:
        inside = view.corners[:, 0] < 500
        kept.append(replace(view, ids=view.ids[inside], corners=view.corners[inside]))
    found = calibrate_views([v for v in kept if len(v.ids) > 15], TARGET)
    (line,) = (
        text
        for text in calibration_advice(found)
        if text.startswith("move the target into and across the ")
    )
    assert "right edge" in line and "left" not in line
    few = calibrate_views(views[:5], TARGET)
    assert "5 views are too few; take 15 to 30" in calibration_advice(few)


def facing(turns: list[tuple[float, float]], distances: tuple[float, ...]) -> list[CharucoView]:
    """Views all over the image of a target that is turned about the image's x and y axes [rad]."""
    rng, views = np.random.default_rng(0), []
    for x, y in turns:
        for distance in distances:
            for aside in ([-0.3, -0.22], [0.3, -0.22], [-0.3, 0.22], [0.3, 0.22], [0.0, 0.0]):
                X_CT = make_pose(cv2.Rodrigues(np.array([x, y, 0.0]))[0], np.zeros(3))
                middle = distance * np.array([*aside, 1.0])
                X_CT[:3, 3] = middle - X_CT[:3, :3] @ [*np.array(TARGET.size) / 2.0, 0.0]
                name = f"view {len(views)}"
                views.append(seen(LENSES["radial4"], np.linalg.inv(X_CT), 0.03, rng, name))
    return [view for view in views if len(view.ids) > 8]


def test_views_enough_of_all_kinds_want_no_others() -> None:
    sides = [(0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)]
    assert wanted_views(calibrate_views(facing(sides, (0.2, 0.3)), TARGET)) == ()


def test_live_views_are_asked_for_until_there_are_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the views that face left, two are needed."""
    sides = [(0.5, 0.0), (-0.5, 0.0), (0.0, -0.5), (0.0, 0.5)]
    views = facing(sides, (0.2, 0.3))
    before = 3 * len(views) // 4
    collector = ViewCollector(TARGET, views[:before])
    blank = Frame(np.zeros((480, 640, 3), np.uint8), None, 0.0, "camera 0")

    def offer(view: CharucoView) -> tuple[bool, str]:
        name = "burg_drake.cameras.calibration.view_guidance.find_target"
        monkeypatch.setattr(name, lambda image, target, name: view)
        assert collector.add_frame(blank) == (False, "hold still")
        return collector.add_frame(blank)

    tilt = "tilt the target by 20 to 45 degrees, so that it faces left"
    assert offer(views[before]) == (True, tilt)
    taken, word = offer(views[before + 1])
    assert taken and word.startswith("enough, the camera is known to 0.") and collector.enough


@pytest.mark.thorough
def test_the_sides_to_which_the_target_was_not_tilted_are_asked_for() -> None:
    """Turned about y, which points down in the image, its right side comes nearer, and it faces
    left; turned about x, its upper side comes nearer, and it faces down."""
    for turns, missing in (
        ([(0.5, 0.0), (-0.5, 0.0), (0.0, 0.5)], "right"),
        ([(0.5, 0.0), (-0.5, 0.0), (0.0, -0.5)], "left"),
        ([(0.0, 0.5), (0.0, -0.5), (-0.5, 0.0)], "down"),
        ([(0.0, 0.5), (0.0, -0.5), (0.5, 0.0)], "up"),
    ):
        lines = wanted_views(calibrate_views(facing(turns, (0.2, 0.3)), TARGET))
        assert lines == (f"tilt the target by 20 to 45 degrees, so that it faces {missing}",)


@pytest.mark.thorough
def test_another_distance_is_asked_for() -> None:
    sides = [(0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)]
    views = facing(sides, (0.25,))
    lines = wanted_views(calibrate_views(views, TARGET))
    assert "take some views from nearer" in lines
    near = [replace(view, side=60.0) for view in views]
    lines = wanted_views(calibrate_views(near, TARGET))
    assert "take some views from farther away" in lines


def test_corners_of_the_image_are_asked_for_by_what_is_known_of_them() -> None:
    """The worst first, with the figure."""
    sides = [(0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)]
    views = []
    for view in facing(sides, (0.2, 0.3)):
        inside = np.linalg.norm(view.corners - [320, 240], axis=1) < 265
        views.append(replace(view, ids=view.ids[inside], corners=view.corners[inside]))
    found = calibrate_views([view for view in views if len(view.ids) > 20], TARGET)
    bounds = found.accuracy.parts
    worst = max(bounds, key=lambda name: bounds[name])
    assert "corner" in worst and bounds[worst] > 2.0 * bounds["middle"]
    (line,) = (text for text in wanted_views(found) if text.startswith("move the target"))
    assert line.startswith(
        f"move the target into and across the {worst} of the image, where the error may be"
        f" {bounds[worst]:.2g} pixels, then"
    )
    assert all(f"{name} corner" in line for name in ("upper left", "lower left", "lower right"))
    assert found.intrinsics.except_at[0] == worst
    assert f"not in the {worst} ({bounds[worst]:.2g})" in str(found.accuracy)


def test_coverage_counts_every_corner_in_its_part_of_the_image() -> None:
    views = views_of(PINHOLE, 5, 0.0)
    counts = corner_coverage(views, (640, 480))
    brute = np.zeros_like(counts)
    for u, v in np.concatenate([view.corners for view in views]):
        brute[int((v + 0.5) // 80), int((u + 0.5) // 80)] += 1
    assert np.array_equal(counts, brute) and counts.sum() == sum(len(v.ids) for v in views)


def test_displacement_of_views() -> None:
    view = views_of(PINHOLE, 1, 0.0)[0]
    moved = replace(view, corners=view.corners + np.array([3.0, 4.0]))
    assert corner_displacement(view, moved) == pytest.approx(5.0 / 800.0)
    part = replace(view, ids=view.ids[:3], corners=view.corners[:3])
    assert corner_displacement(view, part) == float("inf")


def test_live_views_are_still_and_different() -> None:
    camera = Intrinsics(width=320, height=240, focal=(350.0, 350.0), center=(160.0, 120.0))
    rng = np.random.default_rng(3)
    X_TC = looking(rng, 0.2)
    X_TC[:3, 3] = [0.08, 0.11, -0.25]
    image = target_image(TARGET, camera, X_TC)
    collector = ViewCollector(TARGET)

    def offer(picture: np.ndarray) -> tuple[bool, str]:
        return collector.add_frame(Frame(picture, None, 0.0, "camera 0"))

    assert offer(np.zeros_like(image)) == (False, "the image does not show the target")
    assert offer(image) == (False, "hold still")  # nothing to compare it with yet
    assert offer(image)[0]
    assert not offer(image)[0] and len(collector.views) == 1  # the same again
    moved = np.roll(image, 40, axis=1)
    assert offer(moved) == (False, "hold still")
    taken, word = offer(moved)
    assert taken and word == "show the target from other sides, tilted by 20 to 45 degrees"
    assert [view.name for view in collector.views] == ["view 1", "view 2"]
