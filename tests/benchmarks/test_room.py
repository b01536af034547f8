"""The room of the benchmarks against closed forms: where points are, how bright, how far moved.

Dots that reportlab draws take the place of the printed board, OpenCV's lens that of the room's own.
"""

from __future__ import annotations

import io
from functools import cache

import cv2
import numpy as np
import pytest
from reportlab.pdfgen.canvas import Canvas
from room.covers import nothing, things
from room.exposure import PAPER, Surface, no_gloss, radiance, table
from room.lens import SMALL, Camera, Fisheye
from room.light import Light, Shadow, irradiance, map_of
from room.paper import Board, printed, read_pages
from room.rows import Row, picture
from room.sensor import Sensor, image_of
from room.sheet import Faults, Sheet, Texture, assembled, flat, glue
from room.views import look_at, moved, seen_at, shaken

import burg_drake as burg

SIZE = (0.40, 0.30)
RADIUS = 5e-3
DOTS = np.stack(np.meshgrid(0.05 + 0.06 * np.arange(6), 0.05 + 0.05 * np.arange(5)), -1)
DOTS = DOTS.reshape(-1, 2)
POINT = 0.0254 / 72
EVEN = Light(ambient=1.0)
VIEWS = (
    look_at(np.array([0.2, 0.15]), 0.45, 0.0, 0.0, 0.3),
    look_at(np.array([0.22, 0.14]), 0.60, np.radians(50), 1.0, -2.0),
    look_at(np.array([0.18, 0.16]), 1.00, np.radians(60), -2.0, 1.0),
)
STEEP = look_at(np.array([0.2, 0.15]), 0.5, np.radians(35), 0.5, 0.2)
FISHEYE = Fisheye((640, 480), (330.0, 331.0), (322.0, 236.0), projection="equidistant")
"""Whose even angles are those of the fisheye model without coefficients."""
SMALL_BOARD = Board(size=(0.30, 0.25), count=(4, 3))


@cache
def dots() -> Texture:
    """A page with black dots."""
    stream = io.BytesIO()
    canvas = Canvas(stream, pagesize=[s / POINT for s in SIZE])
    for x, y in DOTS / POINT:
        canvas.circle(x, y, RADIUS / POINT, stroke=0, fill=1)
    canvas.save()
    return assembled(SIZE, read_pages(stream.getvalue()), [np.eye(3)])


def surface(light: Light = EVEN, z: float = 0.0) -> Surface:
    """The page with dots on a table, z above it."""
    relief = flat(SIZE)
    relief.z[:] = z
    lit = map_of(irradiance(light, SIZE))
    return Surface(dots(), relief, table(np.random.default_rng(0)), lit, nothing(), no_gloss())


def opencv_pixels(camera: Camera, X_SC: np.ndarray, p_S: np.ndarray) -> np.ndarray:
    """(N, 2) where OpenCV's lens puts points (N, 3)."""
    K = np.array([[camera.focal[0], 0, camera.center[0]], [0, camera.focal[1], camera.center[1]]])
    R = X_SC[:3, :3].T
    bend = np.array(camera.coefficients)
    K = np.r_[K, [[0, 0, 1]]]
    pixels, _ = cv2.projectPoints(p_S, cv2.Rodrigues(R)[0], -R @ X_SC[:3, 3], K, bend)
    return pixels.reshape(-1, 2)


def outline_centroid(camera: Camera, X_SC: np.ndarray, p: np.ndarray, z: float) -> np.ndarray:
    """(2,) centroid of a dot's image, by the polygon of its outline."""
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    rim = p + RADIUS * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    a = opencv_pixels(camera, X_SC, np.c_[rim, np.full(len(rim), z)])
    origin = a.mean(axis=0)
    a = a - origin
    b = np.roll(a, -1, axis=0)
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return origin + ((a + b) * cross[:, None]).sum(axis=0) / (3 * cross.sum())


def moments(
    seen: np.ndarray, about: np.ndarray, reach: int
) -> tuple[np.ndarray, np.ndarray] | None:
    """Centroid (2,) and second moments (2, 2) of what is dark around a pixel; None at the edge."""
    u, v = np.round(about).astype(int)
    height, width = seen.shape[:2]
    if min(u, v) < reach or u + reach >= width or v + reach >= height:
        return None
    part = seen[v - reach : v + reach + 1, u - reach : u + reach + 1, 1]
    dark = PAPER - part
    rows, columns = np.indices(part.shape) - reach
    p = np.stack([columns + u, rows + v], axis=-1).reshape(-1, 2)
    weight = dark.reshape(-1) / dark.sum()
    centroid = weight @ p
    return centroid, (weight[:, None] * (p - centroid)).T @ (p - centroid)


@pytest.mark.parametrize("X_SC", VIEWS)
@pytest.mark.parametrize("z", [0.0, 4e-3])
def test_dots_are_where_the_lens_puts_them(X_SC: np.ndarray, z: float) -> None:
    """On the table and above it, in every view, within 0.02 pixels."""
    seen = radiance(SMALL, X_SC[None, None], surface(z=z))
    off = []
    for p in DOTS:
        expected = outline_centroid(SMALL, X_SC, p, z)
        near = np.linalg.norm(X_SC[:3, 3] - [*p, 0.0])
        found = moments(seen, expected, int(1.5 * RADIUS * SMALL.focal[0] / near) + 2)
        if found is not None:
            off.append(found[0] - expected)
    assert len(off) >= 12
    assert np.abs(off).max() < 0.02
    assert np.abs(np.mean(off, axis=0)).max() < 0.005


def test_own_projection_is_that_of_opencv() -> None:
    p_S = np.c_[DOTS, np.linspace(0, 0.02, len(DOTS))]
    pixels, _ = seen_at(SMALL, STEEP, p_S)
    np.testing.assert_allclose(pixels, opencv_pixels(SMALL, STEEP, p_S), atol=1e-6)
    xy = SMALL.directions(pixels)
    p_C = (p_S - STEEP[:3, 3]) @ STEEP[:3, :3]
    np.testing.assert_allclose(xy, p_C[:, :2] / p_C[:, 2:], atol=1e-9)


def test_motion_smears_dots_by_the_stated_pixels() -> None:
    """A dot that moves d pixels has d²/12 more variance along the motion; its middle stays."""
    p_S = np.c_[DOTS, np.zeros(len(DOTS))]
    twist = shaken(SMALL, STEEP, p_S, 6.0, np.random.default_rng(3))
    times = (np.arange(16) + 0.5) / 16 - 0.5
    still = radiance(SMALL, STEEP[None, None], surface())
    blurred = radiance(SMALL, moved(STEEP, twist, times)[:, None], surface(), side=2)
    ends = [opencv_pixels(SMALL, moved(STEEP, twist, np.array(t)), p_S) for t in (-0.5, 0.5)]
    way = ends[1] - ends[0]
    assert np.sqrt((way**2).sum(axis=1).mean()) == pytest.approx(6.0, rel=1e-3)
    compared = 0
    for p, d in zip(opencv_pixels(SMALL, STEEP, p_S), way, strict=True):
        before, after = moments(still, p, 20), moments(blurred, p, 20)
        if before is None or after is None:
            continue
        compared += 1
        length, along = np.linalg.norm(d), d / np.linalg.norm(d)
        grown = along @ (after[1] - before[1]) @ along
        assert np.sqrt(12 * grown) == pytest.approx(length, rel=0.02, abs=0.02)
        assert np.abs(after[0] - before[0]).max() < 0.03
    assert compared >= 12


def test_a_rolling_shutter_shifts_rows_by_the_time_they_are_read() -> None:
    p_S = np.c_[DOTS, np.zeros(len(DOTS))]
    twist = shaken(SMALL, STEEP, p_S, 8.0, np.random.default_rng(4))
    height = SMALL.size[1]
    time = (np.arange(height) - (height - 1) / 2) / height
    seen = radiance(SMALL, moved(STEEP, twist, time)[None], surface())
    compared = 0
    for p in DOTS:
        expected = outline_centroid(SMALL, STEEP, p, 0.0)
        for _ in range(4):  # the moment depends on the row, which depends on the moment
            t = (expected[1] - (height - 1) / 2) / height
            expected = outline_centroid(SMALL, moved(STEEP, twist, np.array(t)), p, 0.0)
        found = moments(seen, expected, 14)
        if found is not None:
            compared += 1
            assert np.abs(found[0] - expected).max() < 0.05
    assert compared >= 12


def test_the_edge_of_a_shadow_is_where_the_lamp_puts_it() -> None:
    """A plate whose edge is at x = 0.22, y from one side of the board to the other."""
    lamp, height, edge = (0.9, 0.2, 1.5), 0.3, 0.22
    plate = Shadow(tuple((x, y, height) for x, y in [(edge, -1), (edge, 1), (-1, 1), (-1, -1)]))
    X_SC = look_at(np.array([0.15, 0.15]), 0.5, 0.0, 0.0, 0.0)
    light = Light(ambient=0.4, lamp=lamp, shadows=(plate,))
    seen = radiance(SMALL, X_SC[None, None], surface(light))
    x = lamp[0] + (edge - lamp[0]) * lamp[2] / (lamp[2] - height)
    y = 0.075  # between two rows of dots
    (u, v), (dark_u, _), (bright_u, _) = opencv_pixels(
        SMALL, X_SC, np.array([[x, y, 0], [x - 0.01, y, 0], [x + 0.01, y, 0]])
    )
    row = seen[round(v), :, 1]
    assert row[round(dark_u)] == pytest.approx(0.4 * PAPER, rel=0.01)
    low, high = row[round(dark_u)], row[round(bright_u)]
    between = np.arange(round(min(dark_u, bright_u)), round(max(dark_u, bright_u)) + 1)
    bright = ((row[between] - low) / (high - low)).sum()
    assert bright == pytest.approx(bright_u + 0.5 - u, abs=0.1)


def test_light_falls_off_by_distance_and_slant() -> None:
    lamp = (0.2, 0.15, 0.5)
    lit = irradiance(Light(ambient=0.0, lamp=lamp), SIZE)
    middle, column = np.array(lit.shape) // 2, round(0.25 / 0.5e-3)
    slant = np.arctan(0.25 / 0.5)
    ratio = lit[middle[0], middle[1] + column] / lit[middle[0], middle[1]]
    assert ratio == pytest.approx(np.cos(slant) ** 3, rel=0.01)


@pytest.mark.parametrize(
    ("exposure", "level"), [(0.215861, 128), (0.5, 188), (1.0, 255), (1.4, 255)]
)
def test_flat_light_gives_the_levels_of_srgb(exposure: float, level: int) -> None:
    """Values of IEC 61966-2-1."""
    white = np.full((8, 8, 3), 0.7)
    image = image_of(white, 0.7, Sensor(exposure=exposure), np.random.default_rng(0))
    assert (image == level).all()


def test_noise_is_the_root_of_the_electrons() -> None:
    grey = np.full((300, 300, 3), 0.25)
    sensor = Sensor(exposure=1.0, electrons=1000.0, read_noise=8.0)
    image = image_of(grey, 1.0, sensor, np.random.default_rng(0)) / 255.0
    light = ((image + 0.055) / 1.055) ** 2.4
    assert light.mean() == pytest.approx(0.25, abs=1e-3)
    assert light.std() == pytest.approx(np.sqrt(250.0 + 64.0) / 1000.0, rel=0.03)


@pytest.mark.parametrize(
    ("sensor", "variance"),
    [(Sensor(exposure=1.0, blur=1.5), 1.5**2), (Sensor(exposure=1.0, disk=3.0), 3.0**2 / 4)],
)
def test_blur_has_the_stated_size(sensor: Sensor, variance: float) -> None:
    """A Gaussian has its variance along u, a disk a quarter of its radius squared."""
    point = np.zeros((41, 41, 3))
    point[20, 20] = 8.0
    image = image_of(point, 1.0, sensor, np.random.default_rng(0))[..., 1] / 255.0
    assert 0.2 < image.max() < 1.0
    light = np.where(image <= 0.04045, image / 12.92, ((image + 0.055) / 1.055) ** 2.4)
    offsets = np.arange(41) - 20.0
    assert light.sum() == pytest.approx(8.0, rel=0.03)
    spread = (light.sum(axis=0) * offsets**2).sum() / light.sum()
    assert spread == pytest.approx(variance, rel=0.05)


@cache
def glued() -> Sheet:
    """A small board of several pages with errors."""
    pages = printed(SMALL_BOARD, "180x140")
    assert len(pages) > 2
    faults = Faults(offset=2e-3, turn=0.5, bulge=2e-3, scale=(1.003, 0.998))
    return glue(SMALL_BOARD, pages, faults, np.random.default_rng(1))


def test_printed_markers_are_where_the_sheet_says() -> None:
    """Black begins between the corners of each side, within 0.03 mm, whatever went wrong."""
    sheet = glued()
    texture = sheet.texture
    level = texture.texels[: texture.width[0] * texture.height[0], 1]
    canvas = level.reshape(texture.height[0], texture.width[0]).astype(np.float32)
    off = np.arange(-2e-3, 2e-3, 2e-5)
    for corners in sheet.p_SQ[..., :2]:
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            along = (b - a) / np.linalg.norm(b - a)
            line = (a + b) / 2 + off[:, None] * np.array([along[1], -along[0]])  # inwards
            column = (line[:, 0] - texture.left) * texture.per_metre - 0.5
            row = (texture.top - line[:, 1]) * texture.per_metre - 0.5
            at = np.float32(column)[None], np.float32(row)[None]
            brightness = cv2.remap(canvas, *at, cv2.INTER_LINEAR)[0] / 255.0
            assert brightness.sum() * 2e-5 == pytest.approx(2e-3, abs=3e-5)


def test_the_frame_is_the_one_that_fits_the_corners_best() -> None:
    sheet = glued()
    meant = np.dstack([SMALL_BOARD.p_SQ, np.zeros((12, 4))]).reshape(-1, 3)
    off = sheet.p_SQ.reshape(-1, 3) - meant
    assert np.abs(off[:, :2]).max() > 5e-4
    assert np.ptp(off[:, 2]) > 3e-4
    middle = meant - meant.mean(axis=0)
    assert np.abs(off.mean(axis=0)).max() < 1e-7
    assert abs((middle[:, 0] * off[:, 1] - middle[:, 1] * off[:, 0]).mean()) < 1e-9
    plane = np.linalg.lstsq(np.c_[np.ones(len(off)), sheet.p_SQ.reshape(-1, 3)[:, :2]], off[:, 2])[
        0
    ]
    assert np.abs(plane).max() < 1e-6


@pytest.mark.parametrize("share", [0.55, 0.9])
def test_things_cover_the_stated_share_of_markers(share: float) -> None:
    board = Board()
    seen = np.arange(54) % 2 == 0
    cover, stated = things(board, seen, share, EVEN, np.random.default_rng(2))
    assert stated == pytest.approx(share, abs=0.03)
    centres = board.p_SQ[seen].mean(axis=1)
    steps = np.linspace(-0.02, 0.02, 21)
    p = centres[:, None] + np.stack(np.meshgrid(steps, steps), -1).reshape(1, -1, 2)
    cells = np.round((p + 0.1) / 0.5e-3).astype(int)
    covered = cover.radiance[cells[..., 1], cells[..., 0], 3] > 127
    assert covered.mean() == pytest.approx(stated, abs=0.03)


@pytest.mark.parametrize("camera", [SMALL, FISHEYE])
def test_the_board_is_found_in_a_picture_of_the_room(camera: Camera) -> None:
    """An estimator and a room that share no code agree."""
    row = Row(sensor=Sensor())
    taken = picture(row, camera, (5, 0), SMALL_BOARD)
    again = picture(row, camera, (5, 0), SMALL_BOARD)
    assert (taken.image == again.image).all()
    is_fisheye = isinstance(camera, Fisheye)
    intrinsics = burg.cameras.Intrinsics(
        width=640,
        height=480,
        focal=camera.focal,
        center=camera.center,
        model="fisheye" if is_fisheye else "perspective",
        distortion=camera.coefficients[: 4 if is_fisheye else 5],
    )
    markers = burg.scenes.Markers(count=SMALL_BOARD.count)
    board = burg.scenes.Board(size=SMALL_BOARD.size, markers=markers)
    estimate = burg.cameras.BoardPose(board, intrinsics).estimate(taken.image)
    assert estimate.valid
    assert np.linalg.norm(estimate.X_SC[:3, 3] - taken.X_SC[:3, 3]) < 1.5e-3
