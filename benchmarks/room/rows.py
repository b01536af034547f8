"""Named conditions, and pictures that are taken under them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .covers import Cover, hand, nothing, shadow_below, things
from .exposure import PAPER, Gloss, Surface, no_gloss, radiance, table
from .lens import Camera
from .light import Light, Shadow, irradiance, map_of
from .paper import Array, Board, Image, printed
from .sensor import Sensor, image_of
from .sheet import AS_MEANT, COPY_SHARE, Faults, Sheet, glue, with_copy
from .views import moved, random_view, seen_at, shaken

WEBCAM = Sensor(blur=0.6, vignetting=0.25, electrons=3000.0, quality=90)
BOARD = Board(scene="tabletop_six")
MOMENTS = 16
"""Of an exposure in motion."""
SHEETS = 6
"""Sheets of a row whose faults are random; views take turns."""
FEW = (1, 2)


@dataclass(frozen=True)
class Row:
    """A condition.

    Attributes:
        sensor: that takes the picture.
        page: the board is printed on.
        faults: of the sheet.
        motion: in the image while it is exposed [pixels].
        rolling: in the image from the first row to the last one [pixels]; the truth is where the
            camera was at the middle row.
        shadow: a flat thing keeps the lamp from a part of the board: radius of the lamp [m], None
            without shadow.
        hand: one is over the board.
        covered: share of the area of the markers in sight.
        few: one or two markers are in sight as a whole.
        whole: all of the board is in sight. S fits all of the sheet: of what an edge does that is
            out of sight, an image tells nothing.
        gloss: radiance of the lamp's spot over that of white paper.
        copy: a second print of the board lies beside the first one.
        mirrored: the image is, left for right.
        center_off: distance of the camera's principal point from where its intrinsics have it, to
            a random side [pixels].
    """

    sensor: Sensor = WEBCAM
    page: str = "A2"
    faults: Faults = AS_MEANT
    motion: float = 0.0
    rolling: float = 0.0
    shadow: float | None = None
    hand: bool = False
    covered: float = 0.0
    few: bool = False
    whole: bool = False
    gloss: float = 0.0
    copy: bool = False
    mirrored: bool = False
    center_off: float = 0.0


ROWS = {
    "clean": Row(sensor=Sensor()),
    "ordinary": Row(),
    "overexposed 1.4": Row(sensor=replace(WEBCAM, exposure=1.4)),
    "overexposed 2": Row(sensor=replace(WEBCAM, exposure=2.0)),
    "dim": Row(sensor=replace(WEBCAM, exposure=0.06)),
    "defocus 2 px": Row(sensor=replace(WEBCAM, disk=2.0)),
    "motion 4 px": Row(motion=4.0),
    "motion 8 px": Row(motion=8.0),
    "rolling 2 px": Row(rolling=2.0),
    "shadow hard": Row(shadow=0.0),
    "shadow soft": Row(shadow=0.06),
    "hand": Row(hand=True),
    "room": Row(shadow=0.01, motion=4.0, hand=True, sensor=replace(WEBCAM, electrons=1500.0)),
    "55 % covered": Row(covered=0.55),
    "80 % covered": Row(covered=0.80),
    "90 % covered": Row(covered=0.90),
    "few markers": Row(few=True),
    "glued": Row(page="A4", faults=Faults(offset=0.5e-3, turn=0.2)),
    "bulge 2 mm": Row(faults=Faults(bulge=2e-3)),
    "glare": Row(gloss=1.5),
    "rolling 6 px": Row(rolling=6.0),
    "glued 2 mm": Row(page="A4", faults=Faults(offset=2e-3, turn=0.2)),
    "curled edge": Row(faults=Faults(curl=6e-3), whole=True),
    "99 % along x": Row(faults=Faults(scale=(0.99, 1.0))),
    "99.5 % along x": Row(faults=Faults(scale=(0.995, 1.0))),
    "principal point": Row(center_off=0.5),
    "two copies": Row(copy=True),
    "mirrored": Row(mirrored=True),
}
"""By name; `room` is shadow, motion, a hand and twice the noise together."""


@dataclass(frozen=True, eq=False)
class Picture:
    """What was taken.

    Attributes:
        image: (H, W, 3) RGB.
        X_SC: (4, 4) true pose of the optical frame, in the middle of the exposure.
        p_SQ: (N, 4, 3) true corners of the board's markers.
        whole: (N,) markers that are in the image with all corners.
    """

    image: Image
    X_SC: Array
    p_SQ: Array
    whole: NDArray[np.bool_]


def picture(row: Row, camera: Camera, seed: tuple[int, ...], board: Board = BOARD) -> Picture:
    """A picture of a board; the same seed makes the same one.

    Args:
        row: the condition.
        camera: that takes it.
        seed: of the view; the last number chooses a sheet as well.
        board: that lies there.
    """
    rng = np.random.default_rng([*seed, *camera.size])
    lying = sheet(board, row.page, row.faults, seed[-1] % SHEETS)
    X_SC = random_view(rng, board.size)
    while row.whole and not seen_at(camera, X_SC, lying.p_SQ)[1].all():
        X_SC = random_view(rng, board.size)
    if row.copy:
        lying = with_copy(lying, printed(board, row.page), np.pi * (seed[-1] % 2))
        X_SC[0, 3] += rng.uniform(0.0, COPY_SHARE) * board.size[0]
    if row.center_off:
        heading = rng.uniform(-np.pi, np.pi)
        shift = row.center_off * np.array([np.cos(heading), np.sin(heading)])
        camera = replace(camera, center=tuple((np.array(camera.center) + shift).tolist()))
    if row.few:
        X_SC = _few_in_sight(camera, X_SC, lying, rng)
    _, inside = seen_at(camera, X_SC, lying.p_SQ)
    light = _light(row, board.size, rng)
    poses = _poses(row, camera, X_SC, lying.p_SQ[inside.any(axis=1)].reshape(-1, 3), rng)
    surface = _surface(row, lying, light, inside.any(axis=1), X_SC, rng)
    side = 2 if row.motion else 4
    seen = radiance(camera, poses, surface, side)
    image = image_of(seen, PAPER, row.sensor, rng)
    if row.mirrored:
        image = np.ascontiguousarray(image[:, ::-1])
    return Picture(image, X_SC, lying.p_SQ, inside.all(axis=1))


@lru_cache(maxsize=2 * SHEETS)
def sheet(board: Board, page: str, faults: Faults, number: int) -> Sheet:
    """One of the sheets that are glued with such faults."""
    if faults == AS_MEANT:
        number = 0
    return _glued(board, page, faults, number)


@lru_cache(maxsize=SHEETS)
def _glued(board: Board, page: str, faults: Faults, number: int) -> Sheet:
    return glue(board, printed(board, page), faults, np.random.default_rng(number))


def _light(row: Row, size: tuple[float, float], rng: np.random.Generator) -> Light:
    """A lamp to one side, and with a shadow a plate in its way."""
    direction = rng.uniform(-np.pi, np.pi)
    lamp = np.r_[np.array(size) / 2 + 0.9 * np.array([np.cos(direction), np.sin(direction)]), 1.6]
    light = Light(ambient=0.5, lamp=tuple(lamp.tolist()), radius=row.shadow or 0.0)
    if row.shadow is None:
        return light
    height, turn = rng.uniform(0.15, 0.4), rng.uniform(-np.pi, np.pi)
    below = rng.uniform(0.2, 0.8, 2) * size
    middle = np.r_[below, 0.0] + height / lamp[2] * (lamp - np.r_[below, 0.0])
    half = rng.uniform(0.04, 0.2, 2)
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    cos, sin = np.cos(turn), np.sin(turn)
    corners = middle[:2] + signs @ np.array([[cos, sin], [-sin, cos]])
    plate = Shadow(tuple((float(x), float(y), float(middle[2])) for x, y in corners))
    return replace(light, ambient=0.35, shadows=(plate,))


def _poses(row: Row, camera: Camera, X_SC: Array, p_S: Array, rng: np.random.Generator) -> Array:
    """(N, R, 4, 4) of moments and rows."""
    pixels = row.motion or row.rolling
    if not pixels:
        return X_SC[None, None]
    twist = shaken(camera, X_SC, p_S, pixels, rng)
    if row.rolling:
        height = camera.size[1]
        return moved(X_SC, twist, (np.arange(height)[None] - (height - 1) / 2) / height)
    return moved(X_SC, twist, ((np.arange(MOMENTS) + 0.5) / MOMENTS - 0.5)[:, None])


def _surface(
    row: Row,
    lying: Sheet,
    light: Light,
    seen: NDArray[np.bool_],
    X_SC: Array,
    rng: np.random.Generator,
) -> Surface:
    size = lying.board.size
    cover: Cover = nothing()
    if row.hand:
        cover = hand(light, size, rng)
    elif row.covered:
        cover, _ = things(lying.board, seen, row.covered, light, rng)
    lit = irradiance(light, size)
    if cover.height:
        lamp = lit - light.ambient
        lit = light.ambient + lamp * (1.0 - shadow_below(cover, light))
    gloss = no_gloss()
    if row.gloss:  # the lamp where a spot on the board sends its light to the camera
        spot = np.r_[rng.uniform(0.25, 0.75, 2) * size, 0.0]
        toward = (spot - X_SC[:3, 3]) * [1.0, 1.0, -1.0]
        gloss = Gloss(row.gloss, 400.0, spot + 1.5 * toward / np.linalg.norm(toward))
    return Surface(lying.texture, lying.relief, table(rng), map_of(lit), cover, gloss)


def _few_in_sight(camera: Camera, X_SC: Array, lying: Sheet, rng: np.random.Generator) -> Array:
    """The view shifted off the board until one or two markers are left as a whole."""
    heading = rng.uniform(-np.pi, np.pi)
    step = 2e-3 * np.array([np.cos(heading), np.sin(heading), 0.0])
    for _ in range(2000):
        whole = seen_at(camera, X_SC, lying.p_SQ)[1].all(axis=1).sum()
        if whole <= FEW[1]:
            break
        X_SC = X_SC.copy()
        X_SC[:3, 3] += step
    if whole < FEW[0]:  # all went at once: another way
        return _few_in_sight(camera, random_view(rng, lying.board.size), lying, rng)
    return X_SC
