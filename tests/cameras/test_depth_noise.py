"""Depth noise: statistics against closed formulas, shadows against geometry, and what must not be.

Expected values are worked out here from the papers' formulas, in double precision, and from where
planes, boxes and poles are in space.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from burg_drake.cameras import (
    NOISE_PRESETS,
    DepthNoise,
    Intrinsics,
    depth_edges,
    depth_noise,
    hidden_from_second_imager,
    incidence_angle,
    noisy_depth,
)
from burg_drake.core import (
    Array,
    Bytes,
    DocumentError,
    FieldError,
    InvalidInputError,
    Single,
    UnknownNameError,
    save_document,
)

CAMERA = Intrinsics(width=640, height=480, focal=(600.0, 660.0), center=(321.0, 237.0))
SHAPE = (480, 640)
F, B = 600.0, 0.05


def wall(z: float = 1.0) -> Single:
    return np.full(SHAPE, z, dtype=np.float32)


def plane(angle_deg: float, z: float = 1.0, upright: bool = True) -> tuple[Single, Array]:
    """Depth of a plane through (0, 0, z), turned about y or x, and the angles of its rays [rad]."""
    sine, cosine = np.sin(np.deg2rad(angle_deg)), np.cos(np.deg2rad(angle_deg))
    n = np.array([sine, 0.0, cosine] if upright else [0.0, sine, cosine])
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    rays = np.stack([(columns - 321.0) / 600.0, (rows - 237.0) / 660.0, np.ones(SHAPE)], -1)
    depth = z * n[2] / (rays @ n)
    angles = np.arccos(np.abs(rays @ n) / np.linalg.norm(rays, axis=-1))
    return np.where((depth > 0.0) & (depth < 10.0), depth, 0.0).astype(np.float32), angles


def step(near: float = 0.8, far: float = 1.0) -> Single:
    """Near up to column 319, far from 320 on."""
    depth = wall(far)
    depth[:, :320] = near
    return depth


def measured(
    depth: Single,
    noise: DepthNoise,
    seed: int = 0,
    normals: Single | None = None,
    color: Bytes | None = None,
) -> Single:
    rng = np.random.default_rng(seed)
    return noisy_depth(depth, noise, CAMERA, rng, normals=normals, color=color)


@pytest.mark.parametrize("z", [0.5, 1.0, 3.0])
def test_axial_noise_is_what_nguyen_measured(z: float) -> None:
    noise = DepthNoise(axial_base=0.0012, axial_square=0.0019, axial_center=0.4)
    errors = measured(wall(z), noise).astype(float) - z
    sigma = 0.0012 + 0.0019 * (z - 0.4) ** 2
    assert errors.std() == pytest.approx(sigma, rel=0.01)
    assert abs(errors.mean()) < 4.0 * sigma / np.sqrt(errors.size)
    assert np.mean(np.abs(errors) < 1.96 * sigma) == pytest.approx(0.95, abs=0.002)


@pytest.mark.parametrize("given", [True, False])
def test_axial_noise_grows_beyond_60_degrees(given: bool) -> None:
    depth, angles = plane(70.0, 2.0)
    normals = None
    if given:
        turned = [-np.sin(np.deg2rad(70.0)), 0.0, -np.cos(np.deg2rad(70.0))]
        normals = np.broadcast_to(np.float32(turned), (*SHAPE, 3))
    errors = measured(depth, DepthNoise(axial_angle=0.01), normals=normals) - depth.astype(float)
    seen = (depth > 0.0) & (angles < np.deg2rad(81.0))
    steep = seen & (angles > np.deg2rad(61.0))
    growth = (angles / (np.pi / 2 - angles)) ** 2
    scores = errors[steep] / (0.01 / np.sqrt(depth[steep].astype(float)) * growth[steep])
    assert steep.sum() > 50_000 and scores.std() == pytest.approx(1.0, rel=0.02)
    assert not errors[seen & (angles < np.deg2rad(59.0))].any()


@pytest.mark.parametrize("z", [0.4, 1.0, 2.0])
def test_stereo_noise_grows_with_the_square_of_depth(z: float) -> None:
    errors = measured(wall(z), DepthNoise(baseline=B, disparity_sigma=0.08)).astype(float) - z
    assert errors.std() == pytest.approx(z * z * 0.08 / (F * B), rel=0.02)


def test_disparities_come_in_steps() -> None:
    depth, _ = plane(60.0)
    result = measured(depth, DepthNoise(baseline=B, disparity_step=0.125)).astype(float)
    disparity = F * B / result[result > 0.0]
    np.testing.assert_allclose(8.0 * disparity, np.rint(8.0 * disparity), atol=2e-3)
    exact = F * B / depth[result > 0.0].astype(float)
    assert np.abs(disparity - exact).max() == pytest.approx(0.0625, abs=1e-3)
    near_one = np.unique(np.round(result[(result > 0.95) & (result < 1.05)], 6))
    np.testing.assert_allclose(np.diff(near_one), near_one[1:] ** 2 * 0.125 / (F * B), rtol=0.01)


def test_depth_comes_in_steps() -> None:
    result = measured(plane(40.0)[0], DepthNoise(depth_step=0.001)).astype(float)
    np.testing.assert_allclose(1e3 * result, np.rint(1e3 * result), atol=1e-3)


def test_a_far_point_without_disparity_has_no_depth() -> None:
    assert not measured(wall(500.0), DepthNoise(baseline=B, disparity_step=0.125)).any()
    lost = measured(wall(300.0), DepthNoise(baseline=B, disparity_sigma=0.1)) == 0.0
    assert lost.mean() == pytest.approx(norm.cdf(-1.0), abs=0.005)  # F B / z = sigma


@pytest.mark.parametrize("baseline", [0.05, -0.05])
@pytest.mark.parametrize("z1", [0.5, 0.63, 0.8])
def test_the_shadow_of_a_box_is_as_wide_as_its_disparity(baseline: float, z1: float) -> None:
    depth = wall(1.2)
    depth[200:300, 250:400] = z1
    hidden = hidden_from_second_imager(depth, F, baseline, same_view=False)
    width = F * abs(baseline) * (1.0 / z1 - 1.0 / 1.2)
    rows, columns = np.nonzero(hidden)
    assert set(rows) == set(range(200, 300))
    assert abs(hidden[250].sum() - width) <= 0.5
    side = range(250 - hidden[250].sum(), 250) if baseline > 0 else range(400, 400 + len(columns))
    assert set(columns) <= set(side)


def test_the_shadow_of_a_narrow_pole_lies_apart() -> None:
    """Between pole and shadow the wall is seen by both, as a line to the second centre shows."""
    depth = wall(1.2)
    depth[:, 320:326] = 0.5
    hidden = hidden_from_second_imager(depth, F, B, same_view=False)[100]
    columns = np.arange(640)
    x = (columns - 321.0) / F * 1.2
    at_pole = x + (B - x) * (1.2 - 0.5) / 1.2  # where the line to the centre passes z = 0.5
    left, right = ((edge - 321.0) / F * 0.5 for edge in (319.5, 325.5))
    expected = (at_pole > left) & (at_pole < right) & ((columns < 320) | (columns > 325))
    assert expected.sum() == 6 and np.count_nonzero(hidden != expected) <= 1


@pytest.mark.parametrize("angle", [-80.0, -60.0, 0.0, 45.0, 60.0])
def test_a_plane_hides_nothing_of_itself(angle: float) -> None:
    depth, _ = plane(angle, 0.4)
    for baseline in (B, -B):
        assert not hidden_from_second_imager(depth, F, baseline, same_view=False)[:, 100:540].any()


def test_what_the_second_imager_does_not_see_is_lost() -> None:
    hidden = hidden_from_second_imager(wall(0.5), F, B, same_view=True)
    assert hidden[:, :59].all() and not hidden[:, 60:].any()  # F B / 0.5 = 60 pixels
    noise = DepthNoise(baseline=-B, second_view="same")
    assert (measured(wall(0.5), noise) == 0.0).sum() == 480 * 60


def test_frayed_edges_are_as_wide_as_measured() -> None:
    """A pixel shows the other side if its step leads over the edge, which is half a pixel off."""
    result = np.vstack(
        [measured(step(), DepthNoise(lateral_base=0.8), seed) for seed in range(6)]
    ).astype(float)
    for k in range(3):
        expected = norm.sf((k + 0.5) / 0.8)
        assert np.mean(result[:, 320 + k] < 0.9) == pytest.approx(expected, abs=0.025)
        assert np.mean(result[:, 319 - k] > 0.9) == pytest.approx(expected, abs=0.025)
    assert np.mean(result[:, 322] < 0.9) > 0.0002  # 0.0009 by the formula
    assert (result[:, :310] == np.float32(0.8)).all() and (result[:, 330:] == 1.0).all()


def test_corners_fray_along_rows_and_columns_on_their_own() -> None:
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    squares = (rows % 40 < 20) & (columns % 40 < 20)
    depth = np.where(squares, 0.8, 1.0).astype(np.float32)
    corners = (rows % 40 == 19) & (columns % 40 == 19)
    noise = DepthNoise(lateral_base=0.8)
    kept = np.mean([measured(depth, noise, seed)[corners] < 0.9 for seed in range(5)])
    assert kept == pytest.approx(norm.cdf(0.5 / 0.8) ** 2, abs=0.05)


def test_edges_fray_more_on_steep_surfaces() -> None:
    depth, angles = plane(75.0)
    depth[237:] *= np.float32(0.8)
    strong = DepthNoise(lateral_base=0.0, lateral_angle=0.5)
    steep = np.median(angles[237, 300:340])
    sigma = 0.5 * steep / (np.pi / 2 - steep)
    row = depth[236, 300:340]
    shown = np.array([measured(depth, strong, k)[236, 300:340] for k in range(60)])
    assert np.mean(shown < 0.9 * row) == pytest.approx(norm.sf(0.5 / sigma), abs=0.04)


def test_flying_pixels_lie_between_the_surfaces() -> None:
    result = measured(step(), DepthNoise(flying=0.4)).astype(float)
    moved = result != step()
    assert set(np.nonzero(moved)[1]) == {319, 320}
    assert moved[:, 319:321].mean() == pytest.approx(0.4, abs=0.06)
    flying = result[moved]
    assert flying.min() >= 0.8 - 1e-6 and flying.max() <= 1.0 + 1e-6
    assert np.quantile(flying, [0.25, 0.5, 0.75]) == pytest.approx([0.85, 0.9, 0.95], abs=0.02)
    nothing, _ = plane(45.0)
    nothing[:, 320:] = 0.0
    np.testing.assert_array_equal(measured(nothing, DepthNoise(flying=1.0)), nothing)


@pytest.mark.parametrize("size", [0.0, 1.0, 2.0])
def test_dark_surfaces_have_holes(size: float) -> None:
    color = np.full((*SHAPE, 3), 200, dtype=np.uint8)
    color[:, :160], color[:, 160:320], color[:, 320:480] = 0, 20, [60, 5, 3]
    noise = DepthNoise(dark_below=40.0, dark_probability=0.4, hole_size=size)
    lost = np.mean([measured(wall(), noise, k, color=color) == 0.0 for k in range(4)], axis=0)
    red = round(0.299 * 60 + 0.587 * 5 + 0.114 * 3)
    for part, p in zip(
        np.split(lost, 4, axis=1), (0.4, 0.2, 0.4 * (1 - red / 40), 0.0), strict=True
    ):
        assert part.mean() == pytest.approx(p, abs=0.015 if p else 1e-12)
    black = lost[:, :160].astype(bool)
    assert np.mean(black[:, 1:] == black[:, :-1]) > (0.55 if size else 0.0)
    assert not (measured(wall(), noise) == 0.0).any()


@pytest.mark.parametrize("size", [0.0, 1.5])
def test_surfaces_seen_from_aside_have_holes(size: float) -> None:
    depth, angles = plane(65.0)
    noise = DepthNoise(grazing_from_deg=60.0, grazing_to_deg=80.0, hole_size=size)
    lost = np.mean([measured(depth, noise, seed) == 0.0 for seed in range(8)], axis=0)
    degrees = np.rad2deg(angles)
    assert not lost[(degrees < 59.9) & (depth > 0.0)].any()
    assert (lost[degrees > 80.1] == 1.0).all()
    for low in (62, 66, 70, 74):
        band = (degrees > low) & (degrees < low + 2) & (depth > 0.0)
        assert lost[band].mean() == pytest.approx((low + 1 - 60) / 20, abs=0.03)


def test_holes_for_two_reasons_are_independent() -> None:
    noise = DepthNoise(
        grazing_from_deg=0.0, grazing_to_deg=90.0, dark_below=40.0, dark_probability=0.6
    )
    normals = np.zeros((*SHAPE, 3), np.float32)
    normals[:] = np.array([1.0, 0.0, -1.0]) / np.sqrt(2.0)
    lost = measured(wall(), noise, normals=normals, color=np.zeros((*SHAPE, 3), np.uint8)) == 0.0
    assert lost[:, 306:336].mean() == pytest.approx(1.0 - 0.5 * 0.4, abs=0.015)


def test_angles_and_edges_are_those_of_planes() -> None:
    for angle, upright in ((70.0, True), (0.0, True), (30.0, False), (60.0, False)):
        depth, exact = plane(angle, upright=upright)
        seen = depth > 0.0
        assert np.abs(incidence_angle(depth, CAMERA) - exact)[seen].max() < np.deg2rad(0.6)
        assert not depth_edges(depth)[5:-5, 250:].any()
    assert set(np.nonzero(depth_edges(step()))[1]) == {319, 320}
    ends = wall()
    ends[:, 320:] = 0.0
    assert set(np.nonzero(depth_edges(ends))[1]) == {319}
    crease = np.minimum(plane(30.0)[0], plane(-30.0)[0])
    assert not depth_edges(crease).any()


@pytest.mark.parametrize("name", list(NOISE_PRESETS))
def test_planes_stay_where_they_are(name: str) -> None:
    """In space, too: a shift by half a pixel would move the slanted one by 0.8 mm."""
    for depth in (wall(0.8), plane(45.0, 0.8)[0]):
        result = measured(depth, NOISE_PRESETS[name])
        kept = (result > 0.0) & (depth < 1.5)
        assert kept.mean() > 0.5
        errors = result[kept].astype(float) - depth[kept]
        assert abs(np.median(errors)) < 1.5e-4 and abs(errors.mean()) < 1.5e-4


@pytest.mark.parametrize("name", list(NOISE_PRESETS))
def test_nothing_gets_depth_that_had_none(name: str) -> None:
    depth = step()
    depth[100:150, 300:340] = 0.0
    before = depth.copy()
    color = np.random.default_rng(0).integers(0, 255, (*SHAPE, 3), dtype=np.uint8)
    result = measured(depth, NOISE_PRESETS[name], color=color)
    assert not result[depth == 0.0].any() and result.dtype == np.float32
    assert np.isfinite(result).all() and (result >= 0.0).all()
    np.testing.assert_array_equal(depth, before)
    np.testing.assert_array_equal(measured(depth, NOISE_PRESETS[name], color=color), result)
    if name == "none":
        np.testing.assert_array_equal(result, depth)
    else:
        assert (measured(depth, NOISE_PRESETS[name], 1, color=color) != result).any()
    assert not measured(np.zeros_like(depth), NOISE_PRESETS[name], color=color).any()


def test_documents_come_back_and_refuse_what_makes_no_sense(tmp_path: Path) -> None:
    save_document(NOISE_PRESETS["d435"], tmp_path / "noise.yaml")
    assert depth_noise(tmp_path / "noise.yaml") == NOISE_PRESETS["d435"] == depth_noise("d435")
    (tmp_path / "bad.yaml").write_text("version: 1\nbaseline: 0.05\nflying: 1.5\n")
    with pytest.raises(DocumentError, match=r"bad.yaml:3: flying is 1.5; it must be 0 to 1"):
        depth_noise(tmp_path / "bad.yaml")
    with pytest.raises(UnknownNameError, match=r"'d436'.*did you mean"):
        depth_noise("d436")
    with pytest.raises(FieldError, match=r"disparity_sigma.*baseline is 0"):
        DepthNoise(disparity_sigma=0.1)
    with pytest.raises(FieldError, match="grazing_to_deg is 70"):
        DepthNoise(grazing_from_deg=80.0, grazing_to_deg=70.0)
    with pytest.raises(FieldError, match=r"hole_size is 0.5"):
        DepthNoise(hole_size=0.5)


def test_images_that_do_not_fit_are_refused() -> None:
    noise = NOISE_PRESETS["d435"]
    small = replace(CAMERA, width=320, height=240)
    with pytest.raises(InvalidInputError, match="the depth image has 640 x 480 pixels, but"):
        noisy_depth(wall(), noise, small, np.random.default_rng(0))
    with pytest.raises(InvalidInputError, match=r"\(480, 640\) and type uint16; expected \(H, W\)"):
        measured(np.ones(SHAPE, np.uint16), noise)  # type: ignore[arg-type]
    broken = wall()
    broken[7, 9] = np.nan
    with pytest.raises(InvalidInputError, match=r"nan in row 7, column 9"):
        measured(broken, noise)
    with pytest.raises(InvalidInputError, match=r"normals has shape .* and type float32"):
        measured(wall(), noise, normals=np.zeros((4, 4, 3), np.float32))
    with pytest.raises(InvalidInputError, match=r"color has shape .* and type float64"):
        measured(wall(), noise, color=np.zeros((*SHAPE, 3)))  # type: ignore[arg-type]
