"""Images of a ChArUco target with exact truth, to test calibration with."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras import CharucoTarget, Image, Intrinsics
from burg_drake.core import Array
from burg_drake.scene import marker_dictionary
from tests.cameras import synthetic

TABLE, WHITE, BLACK = 0, 1, 2
COLORS = np.array([[128, 112, 96], [235, 235, 232], [22, 22, 24]], dtype=float)
"""Of what lies around the target, its white and its black [8-bit RGB]."""
MARGIN = 0.01
"""White around the squares [m]."""


def target_image(
    target: CharucoTarget,
    intrinsics: Intrinsics,
    X_TC: Array,
    *,
    blur: float = 0.0,
    noise: float = 0.0,
    rng: np.random.Generator | None = None,
) -> Image:
    """What a camera sees of a target.

    Args:
        target: lies in the plane z = 0 of its frame T.
        intrinsics: of the camera.
        X_TC: (4, 4) camera's optical frame in T; it looks along T's z.
        blur: standard deviation of a Gaussian blur [pixels].
        noise: standard deviation of noise [8-bit levels].
        rng: for noise.

    Returns:
        (H, W, 3) RGB image.

    Raises:
        InvalidInputError: part of the image looks past the plane; noise without `rng`.
    """
    # The synthetic images have z out of their sheet: turn T by 180 degrees about its x axis.
    flip = np.diag([1.0, -1.0, -1.0, 1.0])
    sheet: Any = _TargetSheet(target)
    light = synthetic.area_means(sheet, intrinsics, flip @ np.asarray(X_TC, dtype=float))
    return synthetic.degraded(light, synthetic.ImageDegradation(blur=blur, noise=noise), rng)


class _TargetSheet:
    """What lies where on the plane, which is cut along all lines that a square or bit ends at."""

    def __init__(self, target: CharucoTarget) -> None:
        self._x, self._y = (_lines(target, count) for count in target.squares)
        x, y = (0.5 * (lines[:-1] + lines[1:]) for lines in (self._x, self._y))
        self.kinds = np.full((len(self._y) + 1, len(self._x) + 1), TABLE)
        self.kinds[1:-1, 1:-1] = _kinds(target, *np.meshgrid(x, y))

    def region(self, p_S: Array) -> NDArray[np.intp]:
        """Number of the rectangle that holds each point (..., 2) of the plane."""
        row = np.searchsorted(self._y, -p_S[..., 1])
        return row * (len(self._x) + 1) + np.searchsorted(self._x, p_S[..., 0])

    @property
    def colors(self) -> Array:
        """(regions, 3) colour of each."""
        return COLORS[self.kinds.ravel()]

    @property
    def on_table(self) -> NDArray[np.bool_]:
        """(regions,) the region is bare table."""
        return self.kinds.ravel() == TABLE


def _lines(target: CharucoTarget, count: int) -> Array:
    """Where squares, bits and the white around end along an axis with `count` squares [m]."""
    start = target.square * np.arange(count)
    bits = 0.5 * (target.square - target.marker) + target.marker * np.linspace(
        0, 1, _bits(target) + 1
    )
    end = count * target.square
    return np.unique(
        np.round(np.r_[start, end, (start[:, None] + bits).ravel(), -MARGIN, end + MARGIN], 9)
    )


def _bits(target: CharucoTarget) -> int:
    """Bits along a marker's side, border included."""
    return int(marker_dictionary(target.dictionary).markerSize) + 2


def _kinds(target: CharucoTarget, x: Array, y: Array) -> NDArray[np.int_]:
    """What there is at points of T [m]."""
    column, row = (np.floor(v / target.square).astype(int) for v in (x, y))
    columns, rows = target.squares
    on_board = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    kinds = np.where(on_board, BLACK, WHITE)
    n = _bits(target)
    dictionary = marker_dictionary(target.dictionary)
    corners = np.asarray(target.board.getObjPoints())[:, 0, :2]
    for number, corner in zip(target.board.getIds().ravel(), corners, strict=True):
        at = np.floor(corner / target.square).astype(int)
        here = (column == at[0]) & (row == at[1])
        i = np.floor((x - corner[0]) / target.marker * n).astype(int)
        j = np.floor((y - corner[1]) / target.marker * n).astype(int)
        inside = here & (i >= 0) & (i < n) & (j >= 0) & (j < n)
        white = dictionary.generateImageMarker(int(number), n) > 127
        kinds[here] = WHITE
        kinds[inside] = np.where(white[j[inside], i[inside]], WHITE, BLACK)
    return kinds
