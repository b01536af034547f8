"""A photo of the printed board as its top view, true to scale: a backdrop to compose a scene on.

Markers say where the camera was, or, where its intrinsics are not known, how the sheet lies in the
image. What stands on the sheet is drawn as far off as it is high: the view is right in its plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from burg_drake.cameras.optics import NEAR, Intrinsics
from burg_drake.cameras.pose import BoardPose
from burg_drake.cameras.rectification.sheet_fit import SheetFinder
from burg_drake.cameras.sources import Image
from burg_drake.core import Array, InvalidInputError, inverse, transform_points
from burg_drake.scene.document import Board

RESOLUTION = 0.0005
"""Side of a pixel of the top view [m] ..."""
LARGEST = 2048
"""... unless it had more pixels along a side than this, which not every graphics card takes."""
BEYOND = (128, 128, 128)
"""Colour of what the photo does not show."""


@dataclass(frozen=True, eq=False)
class BoardPicture:
    """A top view of a board.

    Attributes:
        image: (H, W, 3) RGB; the first row lies along `upper[1]`, the first column along
            `lower[0]`.
        lower, upper: corners of what it shows in the scene frame [m].
        error: root mean square distance of the markers' corners from where they belong, measured in
            the photo and taken to the sheet [m].
        ids: markers by which the view was made.
        note: what is doubtful about it; "" if nothing is.
    """

    image: Image
    lower: tuple[float, float]
    upper: tuple[float, float]
    error: float
    ids: tuple[int, ...]
    note: str = ""


class BoardRectifier:
    """Makes top views of one board from images of one camera.

    Args:
        board: the printed board.
        intrinsics: of the camera; if None, markers alone say how the sheet lies in the image, and
            how its lens bends straight lines, about.
        margin: how much around the board is shown [m].
        resolution: side of a pixel of the top view [m]; larger ones are taken for large boards.

    Raises:
        InvalidInputError: a number is out of its range.
    """

    def __init__(
        self,
        board: Board,
        intrinsics: Intrinsics | None = None,
        *,
        margin: float = 0.02,
        resolution: float = RESOLUTION,
    ) -> None:
        if not (0.0 <= margin < np.inf and 0.0 < resolution < np.inf):
            raise InvalidInputError(
                f"margin is {margin:g} m and resolution {resolution:g} m; margin must be at least"
                " 0, resolution above 0"
            )
        size = np.array(board.size)
        self._intrinsics = intrinsics
        self._pose = None if intrinsics is None else BoardPose(board, intrinsics)
        self._finder = SheetFinder(board)
        self._lower, self._upper = np.full(2, -margin), size + margin
        extent = self._upper - self._lower
        side = max(resolution, float(extent.max()) / LARGEST)
        self._shape = tuple(int(n) for n in np.maximum(np.rint(extent / side), 1)[::-1])

    def picture(self, image: Image) -> BoardPicture:
        """The top view of an image.

        Args:
            image: (H, W, 3) RGB.

        Raises:
            InvalidInputError: not an image, or of another size than the intrinsics; or it does not
                show the board, or another one.
        """
        image = np.asarray(image)
        if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
            raise InvalidInputError(
                f"the image has shape {image.shape} and type {image.dtype}; expected RGB, (H, W,"
                " 3) uint8"
            )
        p_SQ = self._points()
        if self._pose is None:
            sheet = self._finder.find(image)
            pixels, error, ids, note = sheet.project(p_SQ), sheet.error, sheet.ids, ""
        else:
            pixels, error, ids, note = self._by_pose(image, p_SQ)
        return BoardPicture(
            _sampled(image, pixels.reshape(*self._shape, 2)),
            (float(self._lower[0]), float(self._lower[1])),
            (float(self._upper[0]), float(self._upper[1])),
            error,
            ids,
            note,
        )

    def _points(self) -> Array:
        """(N, 2) middles of the top view's pixels in the scene frame [m], row by row."""
        (rows, columns), extent = self._shape, self._upper - self._lower
        x = self._lower[0] + (np.arange(columns) + 0.5) * extent[0] / columns
        y = self._upper[1] - (np.arange(rows) + 0.5) * extent[1] / rows
        return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)

    def _by_pose(self, image: Image, p_SQ: Array) -> tuple[Array, float, tuple[int, ...], str]:
        assert self._pose is not None and self._intrinsics is not None
        found = self._pose.estimate(image)
        if not found.valid:
            raise InvalidInputError(f"the board was not found in the image: {found.reason}")
        X_CS = inverse(found.X_SC)
        p_CQ = transform_points(X_CS, np.column_stack([p_SQ, np.zeros(len(p_SQ))]))
        ahead = p_CQ[:, 2] >= NEAR
        pixels = np.full((len(p_SQ), 2), -1e6)
        pixels[ahead] = self._intrinsics.project(p_CQ[ahead])
        middle = np.append(0.5 * np.array(self._upper + self._lower), 0.0)
        depth = float(transform_points(X_CS, middle[None])[0, 2])
        error = found.reprojection_error * depth / float(np.mean(self._intrinsics.focal))
        return pixels, error, found.ids, found.reason


def board_picture(
    image: Image,
    board: Board,
    intrinsics: Intrinsics | None = None,
    *,
    margin: float = 0.02,
    resolution: float = RESOLUTION,
) -> BoardPicture:
    """The top view of one image; see `BoardRectifier`, which is for images that follow each other.

    Args:
        image: (H, W, 3) RGB.
        board, intrinsics, margin, resolution: see `BoardRectifier`.

    Raises:
        InvalidInputError: see `BoardRectifier.picture`.
    """
    rectifier = BoardRectifier(board, intrinsics, margin=margin, resolution=resolution)
    return rectifier.picture(image)


def _sampled(image: Image, pixels: Array) -> Image:
    """(H, W, 3) colours of an image at pixels (H, W, 2); where these lie far apart, of as much of
    the image as they stand for."""
    step = np.concatenate([np.diff(pixels, axis=axis).reshape(-1, 2) for axis in (0, 1)])
    shrink = max(1, int(np.median(np.linalg.norm(step, axis=1))))
    if shrink > 1:
        height, width = (n // shrink * shrink for n in image.shape[:2])
        size = width // shrink, height // shrink
        image = np.asarray(
            cv2.resize(image[:height, :width], size, interpolation=cv2.INTER_AREA), np.uint8
        )
        pixels = (pixels + 0.5) / shrink - 0.5
    at = pixels.astype(np.float32)
    return np.asarray(
        cv2.remap(
            *(image, at[..., 0], at[..., 1], cv2.INTER_LINEAR),
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=BEYOND,
        )
    )
