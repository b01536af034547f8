"""The ChArUco calibration target and detection of its corners in an image."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.frame_source import Image
from burg_drake.core import (
    Array,
    FieldError,
    InvalidInputError,
    Single,
    Units,
    linear_levels,
    setting,
    srgb_to_linear,
)
from burg_drake.scene import marker_dictionary

MIN_CORNERS = 8
"""Least number of corners of a usable view."""


@dataclass(frozen=True, kw_only=True)
class CharucoTarget:
    """A ChArUco board.

    Attributes:
        squares: columns and rows of the chessboard.
        square: side of a square [m]. Intrinsics do not depend on it.
        marker: side of a marker, black border included [m]. The white around it decides how small
            squares may be in an image: at squares of 22 to 28 pixels, corners of a board with
            markers of 0.75 squares are off by 0.16 pixels, with 0.7 by 0.02.
        dictionary: OpenCV's name of the markers' dictionary, without `DICT_`.
        legacy: the pattern of OpenCV before 4.6, which other printers of boards use: with an even
            number of rows, the upper left square is white.
    """

    squares: tuple[int, int] = setting((8, 11), "columns and rows of squares", metavar="CxR")
    square: float = setting(
        0.020, "side of a square", unit=Units.millimetres, metavar="SQUARE_MM", above=0
    )
    marker: float = setting(
        0.014, "side of a marker", unit=Units.millimetres, metavar="MARKER_MM", above=0
    )
    dictionary: str = setting("5X5_100", "ArUco dictionary of the markers", metavar="DICTIONARY")
    legacy: bool = setting(False, "the board has the layout of OpenCV before 4.6")

    def __post_init__(self) -> None:
        if min(self.squares) < 3:
            raise FieldError(
                "a target of {} x {} squares is too small; give at least 3 x 3".format(
                    *self.squares
                ),
                "squares",
            )
        if not 0.0 < self.marker < self.square:
            raise InvalidInputError(
                f"markers of {1e3 * self.marker:g} mm do not fit into squares of"
                f" {1e3 * self.square:g} mm; they must be smaller"
            )
        known = len(marker_dictionary(self.dictionary).bytesList)
        needed = self.squares[0] * self.squares[1] // 2
        if needed > known:
            raise InvalidInputError(
                f"a target of {self.squares[0]} x {self.squares[1]} squares needs {needed}"
                f" markers, but {self.dictionary} has {known}; give fewer squares or a larger"
                " dictionary"
            )

    @cached_property
    def board(self) -> Any:
        """OpenCV's board, in metres."""
        dictionary = marker_dictionary(self.dictionary)
        board = cv2.aruco.CharucoBoard(self.squares, self.square, self.marker, dictionary)
        board.setLegacyPattern(self.legacy)
        return board

    @property
    def size(self) -> tuple[float, float]:
        """Width and height [m]."""
        return (self.squares[0] * self.square, self.squares[1] * self.square)

    @cached_property
    def p_TQ(self) -> Array:
        """(N, 3) inner corners of the chessboard, row by row [m]."""
        return np.asarray(self.board.getChessboardCorners(), dtype=float).reshape(-1, 3)

    @cached_property
    def _detector(self) -> Any:
        return cv2.aruco.CharucoDetector(self.board)


@dataclass(frozen=True, eq=False)
class CharucoView:
    """Detected corners of a target in one image.

    Attributes:
        name: of the image.
        size: width and height of the image [pixels].
        ids: (N,) indices of the detected corners, rows of the target's `p_TQ`.
        corners: (N, 2) detected corners [pixels].
        blur: standard deviation of the blur, measured at edges [pixels].
        side: median side of a square in the image [pixels].
    """

    name: str
    size: tuple[int, int]
    ids: NDArray[np.int32]
    corners: Array
    blur: float
    side: float


def find_target(image: Image, target: CharucoTarget, name: str = "image") -> CharucoView | str:
    """Finds the corners of a target in an image.

    Args:
        image: (H, W, 3) RGB or (H, W) gray.
        target: target to detect.
        name: name of the image.

    Returns:
        The view; or the reason why there is none, in a few words.
    """
    gray = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    light = srgb_to_linear(gray)
    found, ids, _, marker_ids = target._detector.detectBoard(linear_levels(light))
    if ids is None or len(ids) == 0:
        seen = 0 if marker_ids is None else len(marker_ids)
        if seen:
            return f"shows {seen} of the target's markers, but no corners between them"
        return "does not show the target"
    ids = np.asarray(ids, dtype=np.int32).ravel()
    corners = np.asarray(found, dtype=float).reshape(-1, 2)
    gap = _marker_gaps(corners, ids, target)
    inside = ((corners > gap[:, None]) & (corners < gray.shape[::-1] - gap[:, None])).all(axis=1)
    clear = gap >= 3.0  # Pixels between a corner and a marker; nearer markers disturb the corner.
    if inside.sum() >= MIN_CORNERS > (inside & clear).sum():
        side = float(np.median(_square_sides(corners, ids, target)))
        return f"shows the target too small: its squares are {side:.0f} pixels wide"
    ids, corners = ids[inside & clear], corners[inside & clear]
    if len(ids) < MIN_CORNERS:
        return f"shows {len(ids)} corners of the target; {MIN_CORNERS} are needed"
    spread = np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)[1]
    # Width of the corners across their main direction, fraction of the diagonal.
    if 2.0 * spread / np.sqrt(len(ids)) < 0.02 * np.hypot(*gray.shape):
        return "shows only corners on one line of the target"
    refined = refine_corners(light, corners, ids, target)
    blur, side = _measure_edges(light, refined, ids, target)
    return CharucoView(name, (gray.shape[1], gray.shape[0]), ids, refined, blur, side)


def refine_corners(
    light: Single, corners: Array, ids: NDArray[np.int32], target: CharucoTarget
) -> Array:
    """Refines corners to the intersections of their edges.

    Args:
        light: (H, W) image in linear light.
        corners: (N, 2) near the corners [pixels].
        ids: (N,) indices of the corners.
        target: target of the corners.

    Returns:
        (N, 2) refined corners [pixels].
    """
    windows = np.clip(np.floor(_marker_gaps(corners, ids, target)), 2, 31).astype(int)
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-4)
    # Pixels. Sharp images are undersampled; this halves the corners' errors.
    smooth = cv2.GaussianBlur(light, (0, 0), 1.0)
    refined = corners.astype(np.float32).reshape(-1, 1, 2)
    for window in np.unique(windows):
        these = windows == window
        refined[these] = cv2.cornerSubPix(
            smooth, np.ascontiguousarray(refined[these]), (int(window),) * 2, (-1, -1), criteria
        )
    return refined.reshape(-1, 2).astype(float)


def _marker_gaps(corners: Array, ids: NDArray[np.int32], target: CharucoTarget) -> Array:
    """(N,) distance to the nearest corner of a marker, along both edges [pixels]."""
    return 0.5 * (1.0 - target.marker / target.square) * _square_sides(corners, ids, target)


def _square_sides(corners: Array, ids: NDArray[np.int32], target: CharucoTarget) -> Array:
    """(N,) shortest side of a square at each corner [pixels]; for corners without detected
    neighbours, the shortest side of all.
    """
    pairs = _neighbour_pairs(ids, target)
    lengths = np.linalg.norm(corners[pairs[:, 0]] - corners[pairs[:, 1]], axis=1)
    sides = np.full(len(ids), np.inf)
    for k in range(2):
        np.minimum.at(sides, pairs[:, k], lengths)
    least = lengths.min(initial=np.inf)
    return np.where(np.isfinite(sides), sides, least if np.isfinite(least) else 16.0)


def _neighbour_pairs(ids: NDArray[np.int32], target: CharucoTarget) -> NDArray[np.int_]:
    """(M, 2) indices into `ids` of corners that are joined by a side of a square."""
    columns = target.squares[0] - 1
    row_of = {int(number): k for k, number in enumerate(ids)}
    pairs = []
    for number, k in row_of.items():
        if (number + 1) % columns and number + 1 in row_of:
            pairs.append((k, row_of[number + 1]))
        if number + columns in row_of:
            pairs.append((k, row_of[number + columns]))
    return np.array(pairs, dtype=int).reshape(-1, 2)


def _measure_edges(
    light: Single, corners: Array, ids: NDArray[np.int32], target: CharucoTarget
) -> tuple[float, float]:
    """Blur and length of the squares' sides [pixels].

    A step blurred by a Gaussian of standard deviation s rises by at most its height / (s sqrt(2
    pi)) per pixel. Motion blurs edges of one direction: the worse direction counts.
    """
    pairs = _neighbour_pairs(ids, target)
    if not len(pairs):
        return float("nan"), float("nan")
    start, along = corners[pairs[:, 0]], corners[pairs[:, 1]] - corners[pairs[:, 0]]
    side = np.linalg.norm(along, axis=1)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / side[:, None]
    reach = np.minimum(0.5 * side, 12.0)
    t = np.linspace(-1.0, 1.0, 49) * reach[:, None]
    places = np.linspace(0.4, 0.6, 5)
    # (M, 5, 49, 2): five lines across each side, averaged against noise.
    p = start[:, None] + along[:, None] * places[:, None]
    p = (p[:, :, None] + across[:, None, None] * t[:, None, :, None]).astype(np.float32)
    u, v = np.moveaxis(p.reshape(len(p), -1, 2), 2, 0)
    lines = cv2.remap(light, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    profile = lines.reshape(p.shape[:3]).mean(axis=1)
    height = profile.max(axis=1) - profile.min(axis=1)
    middle = np.abs(np.linspace(-1.0, 1.0, 49)[1:] - 1 / 48) < 0.25
    steepest = np.abs(np.diff(profile, axis=1))[:, middle].max(axis=1) / (reach / 24)
    blur = height / np.maximum(steepest, 1e-9) / np.sqrt(2.0 * np.pi)
    in_row = np.diff(ids[pairs], axis=1)[:, 0] == 1
    worst = max(float(np.median(blur[kind])) for kind in (in_row, ~in_row) if kind.any())
    return worst, float(np.median(side))
