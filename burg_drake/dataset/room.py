"""A room around the table: its environment map, and the background of images.

The room has walls with windows and furniture, a ceiling with lamps, and a floor. It is drawn once
as an environment map, infinitely far from the camera.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from burg_drake.cameras import Intrinsics
from burg_drake.core import Array, Booleans, Bytes, Single, linear_to_srgb, rng_from
from burg_drake.dataset.appearance import Appearance
from burg_drake.dataset.camera_rays import camera_rays
from burg_drake.dataset.textures import layered_noise
from burg_drake.visualization import linear_light

ENVIRONMENT_ROWS = 512
"""Rows of the environment map, which has twice as many columns."""


@dataclass(frozen=True)
class Panel:
    """A rectangle on a wall.

    Attributes:
        left, right, bottom, top: edges along the wall from its middle, and above the floor [m].
        color: sRGB, from 0 to 1.
        stripes: number of vertical stripes of random tones, like books on a shelf.
    """

    left: float
    right: float
    bottom: float
    top: float
    color: Array
    stripes: int = 0

    def paint(self, image: Array, s: Array, z: Array, rng: np.random.Generator) -> None:
        """Paints the panel into pixels (N, 3) at positions `s`, `z` on the wall."""
        inside = (s > self.left) & (s < self.right) & (z > self.bottom) & (z < self.top)
        tones = rng.uniform(0.5, 1.2, (max(1, self.stripes), 3))
        share = (s[inside] - self.left) / (self.right - self.left)
        stripe = np.minimum(share * len(tones), len(tones) - 1).astype(np.intp)
        image[inside] = self.color * (tones[stripe] if self.stripes else 1.0)


@lru_cache(maxsize=4)
def environment_map(seed: int) -> Bytes:
    """Draws the environment map of a room. The array is read-only; recent maps are cached.

    Args:
        seed: seed of the room.

    Returns:
        (ENVIRONMENT_ROWS, 2 ENVIRONMENT_ROWS, 3) sRGB; see `environment_directions` for the
        directions of its pixels.
    """
    rng = rng_from("room", seed)
    d_W = environment_directions()
    half = np.array([rng.uniform(2.0, 4.5), rng.uniform(2.0, 4.5)])
    height = rng.uniform(2.5, 3.3)
    p_W = np.array([*(rng.uniform(-0.5, 0.5, 2) * half), 0.75])  # on the table
    upper = np.array([*half, height])
    lower = np.array([*-half, 0.0])
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(d_W > 0.0, upper - p_W, lower - p_W) / d_W
    distance = np.where(np.isfinite(distance) & (distance >= 0.0), distance, np.inf)
    face, hit_distance = distance.argmin(axis=2), distance.min(axis=2)
    p_WQ = p_W + hit_distance[..., None] * d_W
    image = np.zeros_like(d_W)
    positive = np.take_along_axis(d_W, face[..., None], axis=2)[..., 0] > 0.0
    wall = np.array([rng.uniform(0.62, 0.9)] * 3) + rng.uniform(-0.06, 0.06, 3)
    windows = rng.permutation(4) < int(rng.integers(1, 3))
    for k in range(4):
        axis, side = k % 2, k < 2
        on = (face == axis) & (positive == side)
        s, z = p_WQ[on][:, 1 - axis], p_WQ[on][:, 2]
        tone = wall * rng.uniform(0.85, 1.0)
        image[on] = _wall_colors(tone, s, z, float(half[1 - axis]), bool(windows[k]), rng)
    _paint_floor(image, p_WQ, (face == 2) & ~positive, rng)
    _paint_ceiling(image, p_WQ, (face == 2) & positive, half, rng)
    near_edge = np.sort(np.minimum(p_WQ - lower, upper - p_WQ), axis=2)[..., 1]
    image *= (1.0 - 0.35 * np.exp(-near_edge / 0.35))[..., None]
    blurred = _blur_environment(image, rng.uniform(0.8, 4.0))
    found = np.asarray(np.clip(blurred * 255.0 + 0.5, 0.0, 255.0), dtype=np.uint8)
    found.setflags(write=False)
    return found


def room_radiance(seed: int, irradiance: float) -> Single:
    """Radiance map of a room.

    Args:
        seed: seed of the room.
        irradiance: irradiance of a table; at 1 a white surface is white in the image.

    Returns:
        (64, 128, 3) linear radiance, arranged as `environment_map`.
    """
    radiance_rows = 64  # Rows of the image that lights the scene.
    seen = environment_map(seed) / 255.0
    light = linear_light(seen)
    light[np.all(seen > 0.98, axis=2)] *= 8.0  # lamps and windows
    size = (2 * radiance_rows, radiance_rows)
    small = np.asarray(cv2.resize(light, size, interpolation=cv2.INTER_AREA))
    up = environment_directions(radiance_rows)[..., 2]
    sine = np.sqrt(1.0 - up**2)  # the area of a pixel
    weight = np.maximum(up, 0.0) * sine
    table = (small.mean(axis=2) * weight).sum() / weight.sum()
    return np.asarray(small * (irradiance / table), dtype=np.float32)


def environment_directions(rows: int = ENVIRONMENT_ROWS) -> Array:
    """(rows, 2 rows, 3) unit vectors in the world of the pixels' centres: the first row points up,
    the middle of a row along x, and a quarter of the image to the left of it along y."""
    row = (np.arange(rows) + 0.5) / rows
    column = (np.arange(2 * rows) + 0.5) / (2 * rows)
    polar, azimuth = np.pi * row[:, None], 2.0 * np.pi * (0.5 - column)[None]
    flat = np.sin(polar)
    return np.stack(
        [flat * np.cos(azimuth), flat * np.sin(azimuth), np.cos(polar) + 0.0 * azimuth], axis=2
    )


def environment_pixels(d_W: Array) -> Array:
    """(..., 2) column and row in the environment map of unit vectors (..., 3) in the world, pixel
    centres at integers."""
    azimuth = np.arctan2(d_W[..., 1], d_W[..., 0])
    polar = np.arccos(np.clip(d_W[..., 2], -1.0, 1.0))
    column = (0.5 - azimuth / (2.0 * np.pi)) * 2 * ENVIRONMENT_ROWS - 0.5
    return np.stack([column, polar / np.pi * ENVIRONMENT_ROWS - 0.5], axis=-1)


def _wall_colors(
    tone: Array, s: Array, z: Array, half: float, windows: bool, rng: np.random.Generator
) -> Array:
    """(N, 3) colours at positions on a wall: `s` along it from its middle, `z` above the floor."""
    image = np.broadcast_to(tone, (len(s), 3)) * (0.9 + 0.06 * z[:, None])
    panels = _window_panels(half, rng) if windows else _furniture_panels(half, rng)
    skirting = Panel(-half, half, 0.0, 0.08, tone * 0.7)
    for panel in (skirting, *panels):
        panel.paint(image, s, z, rng)
    return image


def _window_panels(half: float, rng: np.random.Generator) -> list[Panel]:
    """Bright panes in white frames."""
    found, count = [], int(rng.integers(1, 4))
    sky = np.array([0.9, 0.96, 1.0]) * rng.uniform(0.85, 1.1)
    bottom, top = rng.uniform(0.8, 1.1), rng.uniform(1.9, 2.4)
    width = 2.0 * half / count
    for k in range(count):
        left = -half + (k + 0.15) * width
        right = left + 0.7 * width
        frame = np.array([0.85, 0.85, 0.83])
        found.append(Panel(left - 0.06, right + 0.06, bottom - 0.06, top + 0.06, frame))
        middle = 0.5 * (left + right)
        ground = np.array([0.45, 0.5, 0.4]) * rng.uniform(0.8, 1.3)
        for a, b in ((left, middle - 0.03), (middle + 0.03, right)):
            found.append(Panel(a, b, bottom, top, sky))
            found.append(Panel(a, b, bottom, bottom + 0.25 * (top - bottom), ground))
    return found


def _furniture_panels(half: float, rng: np.random.Generator) -> list[Panel]:
    """Cupboards, shelves, doors and pictures, side by side."""
    found, left = [], -half + rng.uniform(0.1, 0.6)
    while left < half - 0.5:
        width = min(rng.uniform(0.5, 1.3), half - 0.1 - left)
        color = rng.uniform(0.15, 0.8) * (1.0 + rng.uniform(-0.25, 0.25, 3))
        kind = int(rng.integers(4))
        if kind == 0:  # a door
            found.append(Panel(left, left + min(width, 0.9), 0.0, 2.0, 0.4 + 0.5 * color))
        elif kind == 1:  # a picture
            found.append(Panel(left, left + 0.7 * width, 1.2, 1.2 + 0.6 * width, color * 0.4))
            found.append(
                Panel(left + 0.03, left + 0.7 * width - 0.03, 1.23, 1.17 + 0.6 * width, color, 4)
            )
        else:  # a cupboard or a shelf
            top = rng.uniform(0.7, 2.1)
            found.append(Panel(left, left + width, 0.05, top, color))
            boards = int(top / 0.38) if kind == 2 else 0
            for k in range(boards):
                low = 0.1 + 0.38 * k
                books = int(rng.integers(6, 20))
                found.append(
                    Panel(left + 0.04, left + width - 0.04, low, low + 0.28, color * 0.9, books)
                )
        left += width + rng.uniform(0.05, 0.8)
    return found


def _paint_floor(image: Array, p_WQ: Array, on: Booleans, rng: np.random.Generator) -> None:
    noise_size = 512  # Pixels along each side of the noise image.
    tone = rng.uniform(0.25, 0.6) * (1.0 + np.array([0.12, 0.0, -0.15]) * rng.uniform(-0.3, 1.0))
    spots = layered_noise(rng, noise_size, 8, 8, 5)
    x, y = (np.floor(p_WQ[on][:, :2] * 100.0).astype(np.intp) % noise_size).T
    boards = np.where((p_WQ[on][:, 0] / 0.18) % 1.0 < 0.04, 0.8, 1.0)
    image[on] = tone * ((0.8 + 0.4 * spots[y, x]) * boards)[:, None]


def _paint_ceiling(
    image: Array, p_WQ: Array, on: Booleans, half: Array, rng: np.random.Generator
) -> None:
    """White, with rows of lamps."""
    p = p_WQ[on][:, :2]
    colors = np.broadcast_to(np.array([0.88, 0.87, 0.85]) * rng.uniform(0.85, 1.0), (len(p), 3))
    count, size = rng.integers(1, 4, 2), rng.uniform(0.1, 0.4, 2)
    share = (p / half + 1.0) * 0.5 * count
    from_middle = np.abs(share % 1.0 - 0.5) * 2.0 * half / count
    lamp = np.all(from_middle < size, axis=1)
    image[on] = np.where(lamp[:, None], 1.1, colors)


def _blur_environment(image: Array, sigma: float) -> Array:
    """Blurs an environment map; its columns wrap around."""
    margin = 32
    wide = np.concatenate([image[:, -margin:], image, image[:, :margin]], axis=1)
    return np.asarray(cv2.GaussianBlur(wide, (0, 0), sigma)[:, margin:-margin])


NO_SURFACE_COLOR = (255, 0, 254)
"""sRGB of pixels without a surface in the renderer's images. No surface has this colour."""
BACKGROUND_GREY = 150
"""sRGB value of the background of an appearance without a room."""
NO_APPEARANCE_COLOR = (204, 229, 255)
"""sRGB background without an appearance, as behind the images of simulated cameras."""


def fill_background(
    color: Bytes, X_WC: Array, intrinsics: Intrinsics, appearance: Appearance
) -> Bytes:
    """Fills pixels without a surface with the room.

    Args:
        color: (H, W, 3) image of the renderer that `apply_appearance` adds.
        X_WC: (4, 4) pose of the camera's optical frame in the world.
        intrinsics: intrinsics of the camera.
        appearance: appearance with the room.

    Returns:
        (H, W, 3) sRGB; the same array if every pixel shows a surface.
    """
    nothing = (color == NO_SURFACE_COLOR).all(axis=2)
    if not nothing.any():
        return color
    edge = cv2.dilate(nothing.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool) & ~nothing
    seen_behind = nothing | edge
    behind = _background_colors(seen_behind, X_WC, intrinsics, appearance)
    filled = np.where(nothing[..., None], behind, color)
    filled[edge] = _blend_edge_pixels(color, nothing, edge, behind)
    return filled


def blend_over_background(
    color: Bytes, X_WC: Array, intrinsics: Intrinsics, appearance: Appearance | None
) -> Bytes:
    """Blends an image over the room, in linear light.

    Args:
        color: (H, W, 4) sRGB and coverage of each pixel by surfaces, not premultiplied.
        X_WC: (4, 4) pose of the camera's optical frame in the world.
        intrinsics: intrinsics of the camera.
        appearance: appearance with the room; None for the sky of simulated cameras.

    Returns:
        (H, W, 3) sRGB.
    """
    found, share = color[..., :3].copy(), color[..., 3]
    mixed = share < 255
    if mixed.any():
        behind = _background_colors(mixed, X_WC, intrinsics, appearance)[mixed]
        part = share[mixed, None] / 255.0
        before = linear_light(found[mixed] / 255.0)
        light = part * before + (1.0 - part) * linear_light(behind / 255.0)
        found[mixed] = linear_to_srgb(light)
    return found


def _background_colors(
    where: Booleans, X_WC: Array, intrinsics: Intrinsics, appearance: Appearance | None
) -> Bytes:
    """(H, W, 3) background, in pixels of the mask `where`."""
    behind = np.empty((*where.shape, 3), np.uint8)
    behind[:] = NO_APPEARANCE_COLOR if appearance is None else BACKGROUND_GREY
    if appearance is not None and appearance.room is not None:
        d_W = camera_rays(intrinsics).unit[where] @ X_WC[:3, :3].T
        behind[where] = _sample_environment_map(
            environment_map(appearance.room), environment_pixels(d_W)
        )
    return behind


def _blend_edge_pixels(color: Bytes, nothing: Booleans, edge: Booleans, behind: Bytes) -> Bytes:
    """(N, 3) pixels on edges, blended with the background instead of `NO_SURFACE_COLOR`.

    The share of `NO_SURFACE_COLOR` in a pixel follows from its excess of red and blue over green,
    compared with unblended pixels around it.
    """
    solid = (~nothing & ~edge).astype(np.float32)
    excess = color[..., [0, 2]].astype(np.float32).mean(axis=2) - color[..., 1]
    solid_count = cv2.boxFilter(solid, -1, (5, 5), normalize=False)[edge]
    total = cv2.boxFilter(excess * solid, -1, (5, 5), normalize=False)[edge]
    surface_excess = total / np.maximum(solid_count, 1.0)
    full_excess = 0.5 * (NO_SURFACE_COLOR[0] + NO_SURFACE_COLOR[2]) - NO_SURFACE_COLOR[1]
    share = np.clip((excess[edge] - surface_excess) / (full_excess - surface_excess), 0.0, 1.0)[
        :, None
    ]
    mixed = color[edge] + share * (
        behind[edge].astype(np.float32) - np.array(NO_SURFACE_COLOR, np.float32)
    )
    return np.asarray(np.clip(mixed + 0.5, 0.0, 255.0), dtype=np.uint8)


def _sample_environment_map(room: Bytes, pixels: Array) -> Bytes:
    """(N, 3) colours at columns and rows (N, 2), looked up in batches that OpenCV accepts."""
    at = pixels.astype(np.float32)[None]
    batch_size = (1 << 15) - 2
    parts = [
        cv2.remap(
            room, at[:, k : k + batch_size], None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP
        )
        for k in range(0, at.shape[1], batch_size)
    ]
    return np.asarray(np.concatenate(parts, axis=1)[0])
