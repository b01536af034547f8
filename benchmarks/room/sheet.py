"""The sheet that is glued of pages, with errors, and not flat."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from .paper import Array, Board, Image, Page

TEXELS = 300 / 0.0254
"""Of the sheet [1/m]."""
LEVELS = 6
"""The sheet at full size, and halved that many times less one."""
RIM = 6e-3
"""What of the pages stays around the board [m]; they are trimmed there."""
RELIEF = 0.01
"""Distance of the points that a sheet's heights are given at [m]."""
CURLED = 0.15
"""Width of the strip along an edge that curls [m]."""
COPY_GAP, COPY_SHARE = 0.03, 0.6
"""Between a sheet and its copy, and how much of the copy is there [widths of the sheet]."""


class Texture(NamedTuple):
    """What is printed, filtered for cameras of all distances.

    Attributes:
        texels: (N, 4) of all levels, row by row from the upper left: linear reflectance times
            cover, and cover: 255 where there is paper.
        start, width, height: (L,) of each level.
        left, top: of the upper left corner in S [m].
        per_metre: texels of level 0 [1/m].
    """

    texels: Image
    start: NDArray[np.int64]
    width: NDArray[np.int64]
    height: NDArray[np.int64]
    left: float
    top: float
    per_metre: float


class Relief(NamedTuple):
    """Heights of the sheet over z = 0, bilinear between points.

    Attributes:
        z: (R, C) [m], row 0 at the least y.
        left, bottom: of the first point [m].
        step: between points [m].
    """

    z: NDArray[np.float32]
    left: float
    bottom: float
    step: float

    def at(self, p: Array) -> Array:
        """(...,) heights at points (..., 2)."""
        column = np.clip((p[..., 0] - self.left) / self.step, 0, self.z.shape[1] - 1.001)
        row = np.clip((p[..., 1] - self.bottom) / self.step, 0, self.z.shape[0] - 1.001)
        i, j = row.astype(int), column.astype(int)
        s, t = row - i, column - j
        z = self.z.astype(float)
        lower = (1 - t) * z[i, j] + t * z[i, j + 1]
        upper = (1 - t) * z[i + 1, j] + t * z[i + 1, j + 1]
        return (1 - s) * lower + s * upper


@dataclass(frozen=True)
class Faults:
    """What goes wrong when a board is printed and glued.

    Attributes:
        offset: of a page, the most along x and y [m].
        turn: of a page, the most [deg].
        bulge: the most that the sheet is above the table [m].
        curl: height of an edge of the sheet [m].
        scale: of the print along x and y of the page.
    """

    offset: float = 0.0
    turn: float = 0.0
    bulge: float = 0.0
    curl: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)


AS_MEANT = Faults()
"""Of a sheet that is printed as it should be, and flat."""


@dataclass(frozen=True, eq=False)
class Sheet:
    """A board as it lies on the table.

    S is the frame that fits the printed corners best, in the least squares sense: what a sheet is
    off as a whole, errors of its pages do not tell.

    Attributes:
        board: that was meant.
        texture: what is printed.
        relief: of the sheet.
        p_SQ: (N, 4, 3) true corners of the markers [m].
    """

    board: Board
    texture: Texture
    relief: Relief
    p_SQ: Array


def glue(board: Board, pages: tuple[Page, ...], faults: Faults, rng: np.random.Generator) -> Sheet:
    """Glues the pages of a board, each a little off, on a table that makes them bulge."""
    turns = np.radians(faults.turn) * rng.uniform(-1, 1, len(pages))
    offsets = faults.offset * rng.uniform(-1, 1, (len(pages), 2))
    places = [
        _place(page, faults.scale, *each) for page, *each in zip(pages, turns, offsets, strict=True)
    ]
    corners = board.p_SQ
    home = [_page_of(pages, p) for p in corners.mean(axis=1)]
    printed = np.stack(
        [_moved(places[k], p + pages[k].p_PS) for k, p in zip(home, corners, strict=True)]
    )
    best = _rigid_fit(printed.reshape(-1, 2), corners.reshape(-1, 2))
    printed = _moved(best, printed)
    texture = assembled(board.size, pages, [best @ place for place in places])
    relief = _relief(board.size, faults, rng, printed)
    return Sheet(board, texture, relief, np.dstack([printed, relief.at(printed)]))


def assembled(size: tuple[float, float], pages: tuple[Page, ...], places: list[Array]) -> Texture:
    """Lays page over page, as they are glued.

    Args:
        size: of the board [m].
        pages: in the order in which they are laid.
        places: (3, 3) of each, from its lower left corner to S [m].
    """
    width, height = (int(np.ceil((s + 2 * RIM) * TEXELS / 32)) * 32 for s in size)
    left, top = -RIM, height / TEXELS - RIM
    canvas = np.zeros((height, width, 4), np.uint8)
    to_canvas = np.array(
        [[TEXELS, 0, -0.5 - left * TEXELS], [0, -TEXELS, top * TEXELS - 0.5], [0, 0, 1]]
    )
    for page, place in zip(pages, places, strict=True):
        rows, columns = page.reflectance.shape[:2]
        x, y = columns / page.size[0], rows / page.size[1]
        to_page = np.array([[1 / x, 0, 0.5 / x], [0, -1 / y, page.size[1] - 0.5 / y], [0, 0, 1]])
        cut = np.full((rows, columns, 4), 255, np.uint8)
        cut[..., :3] = page.reflectance
        if page.cut_left is not None:
            cut[:, : round(page.cut_left * x)] = 0
        if page.cut_top is not None:
            cut[: round((page.size[1] - page.cut_top) * y)] = 0
        shown = cv2.warpAffine(cut, (to_canvas @ place @ to_page)[:2], (width, height))
        below = 255 - shown[..., 3:]
        canvas = shown + cv2.multiply(canvas, np.broadcast_to(below, canvas.shape), scale=1 / 255)
    return texture_of(canvas, left, top, TEXELS)


def flat(size: tuple[float, float]) -> Relief:
    """That of a sheet without bulges."""
    return _relief(size, AS_MEANT, np.random.default_rng(0), None)


def texture_of(canvas: Image, left: float, top: float, per_metre: float) -> Texture:
    """A texture of (H, W, 4) texels, each level the means of two by two of the one before."""
    levels = [canvas]
    for _ in range(LEVELS - 1):
        last = levels[-1]
        even = last[: len(last) // 2 * 2, : last.shape[1] // 2 * 2]
        levels.append(cv2.resize(even, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    sizes = np.array([level.shape[:2] for level in levels], dtype=np.int64)
    start = np.r_[0, np.cumsum(sizes.prod(axis=1))[:-1]]
    texels = np.concatenate([level.reshape(-1, 4) for level in levels])
    return Texture(texels, start, sizes[:, 1].copy(), sizes[:, 0].copy(), left, top, per_metre)


def _place(page: Page, scale: tuple[float, float], turn: float, offset: Array) -> Array:
    """(3, 3) from a page to S: scaled and turned about its middle, and shifted."""
    middle = np.array(page.size) / 2
    cos, sin = np.cos(turn), np.sin(turn)
    place = np.eye(3)
    place[:2, :2] = np.array([[cos, -sin], [sin, cos]]) @ np.diag(scale)
    place[:2, 2] = middle - page.p_PS + offset - place[:2, :2] @ middle
    return place


def _moved(place: Array, p: Array) -> Array:
    return p @ place[:2, :2].T + place[:2, 2]


def _page_of(pages: tuple[Page, ...], p_S: Array) -> int:
    """The page that shows a point: the last one that is not cut before it."""
    for k in reversed(range(len(pages))):
        page = pages[k]
        x, y = p_S + page.p_PS
        inside = (page.cut_left or 0.0) < x < page.size[0]
        if inside and 0.0 < y < (page.cut_top or page.size[1]):
            return k
    raise ValueError(f"no page shows the board's point {p_S.tolist()} [m]")


def _rigid_fit(p: Array, to: Array) -> Array:
    """(3, 3) the turn and shift that bring points (N, 2) closest to others."""
    a, b = p - p.mean(axis=0), to - to.mean(axis=0)
    turn = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
    fit = np.eye(3)
    fit[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    fit[:2, 2] = to.mean(axis=0) - fit[:2, :2] @ p.mean(axis=0)
    return fit


def _relief(
    size: tuple[float, float], faults: Faults, rng: np.random.Generator, fit: Array | None
) -> Relief:
    """Two to four round hills and an edge that curls up, less the plane that fits corners best."""
    x, y = (np.arange(-5, int(s / RELIEF) + 7) * RELIEF for s in size)
    p = np.stack(np.meshgrid(x, y), axis=-1)
    z = np.zeros(p.shape[:2])
    if faults.bulge > 0.0:
        for _ in range(rng.integers(2, 5)):
            middle, width = rng.uniform(0, 1, 2) * size, rng.uniform(0.06, 0.15)
            z += rng.uniform(0.4, 1) * np.exp(-((p - middle) ** 2).sum(axis=-1) / 2 / width**2)
        z *= faults.bulge / z.max()
    if faults.curl > 0.0:
        axis, far = rng.integers(0, 2, 2)
        inward = np.clip(size[axis] - p[..., axis] if far else p[..., axis], 0.0, CURLED)
        z += faults.curl * (1.0 - inward / CURLED) ** 2
    relief = Relief(z.astype(np.float32), float(x[0]), float(y[0]), RELIEF)
    if z.any() and fit is not None:
        points = fit.reshape(-1, 2)
        terms = np.c_[np.ones(len(points)), points]
        plane = np.linalg.lstsq(terms, relief.at(points), rcond=None)[0]
        z -= plane[0] + p @ plane[1:]
        relief = relief._replace(z=z.astype(np.float32))
    return relief


def with_copy(sheet: Sheet, pages: tuple[Page, ...], turn: float) -> Sheet:
    """The sheet with another print of the same board to its right, of which a part is there.

    Args:
        sheet: as it lies on the table.
        pages: of the board.
        turn: of the copy about its middle [rad].
    """
    width, height = sheet.board.size
    cos, sin = np.cos(turn), np.sin(turn)
    middle = np.array([width, height]) / 2
    beside = np.eye(3)
    beside[:2, :2] = [[cos, -sin], [sin, cos]]
    beside[:2, 2] = middle + np.r_[(1.0 + COPY_GAP) * width, 0.0] - beside[:2, :2] @ middle
    places = [_place(page, (1.0, 1.0), 0.0, np.zeros(2)) for page in pages]
    laid = [*(beside @ place for place in places), *places]
    texture = assembled(((1.0 + COPY_SHARE) * width, height), (*pages, *pages), laid)
    return replace(sheet, texture=texture)
