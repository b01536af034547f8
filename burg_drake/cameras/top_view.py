"""Rectify photos of the printed board to top views that are true to scale.

A calibrated camera is not needed: homography and distortion are fitted to the markers.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from scipy.optimize import least_squares

from burg_drake.cameras.frame_source import CameraLost, FrameSource, Image, require_rgb
from burg_drake.cameras.intrinsics import NEAR_DISTANCE, Intrinsics
from burg_drake.cameras.pose.board_pose import BoardPose, grey_image
from burg_drake.cameras.pose.coarse_pose import CORNER_TOLERANCE, consistent_markers
from burg_drake.cameras.pose.marker_detection import (
    MarkerDetector,
    find_foreign_markers,
    misplaced_reason,
    no_markers_reason,
    side_lengths,
)
from burg_drake.core import Array, Bytes, InvalidInputError, inverse, transform_points
from burg_drake.scene import Board

DEFAULT_PIXEL_SIZE = 0.0005
"""Metres. Side of a pixel of the top view."""
MAX_PICTURE_SIDE = 2048
"""Largest side of the top view in pixels; a limit of some graphics cards."""


@dataclass(frozen=True, eq=False)
class BoardPicture:
    """A top view of a board.

    Attributes:
        image: (H, W, 3) RGB; the first row lies along `upper[1]`, the first column along
            `lower[0]`.
        lower, upper: corners of the shown area in the scene frame [m].
        error: root mean square distance of the markers' corners in the photo, projected to the
            sheet, from their places [m].
        ids: ids of the used markers.
        note: reason to doubt the view; "" if there is none.
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
        intrinsics: of the camera; if None, homography and approximate distortion are fitted to the
            markers.
        margin: width of the shown area around the board [m].
        resolution: side of a pixel of the top view [m]; increased for large boards.

    Raises:
        InvalidInputError: a number is out of its range.
    """

    def __init__(
        self,
        board: Board,
        intrinsics: Intrinsics | None = None,
        *,
        margin: float = 0.02,
        resolution: float = DEFAULT_PIXEL_SIZE,
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
        side = max(resolution, float(extent.max()) / MAX_PICTURE_SIDE)
        self._shape = tuple(int(n) for n in np.maximum(np.rint(extent / side), 1)[::-1])

    def picture(self, image: Image) -> BoardPicture:
        """Rectifies an image to a top view.

        Args:
            image: (H, W, 3) RGB.

        Raises:
            InvalidInputError: the image is none, has another size than the intrinsics, or shows no
                board or another one.
        """
        image = np.asarray(image)
        require_rgb(image)
        p_SQ = self._pixel_centres()
        if self._pose is None:
            sheet = self._finder.find(image)
            pixels, error, ids, note = sheet.project(p_SQ), sheet.error, sheet.ids, ""
        else:
            pixels, error, ids, note = self._project_by_pose(image, p_SQ)
        top = _sample_image(image, pixels.reshape(*self._shape, 2))
        lower, upper = ((float(x), float(y)) for x, y in (self._lower, self._upper))
        return BoardPicture(top, lower, upper, error, ids, note)

    def _pixel_centres(self) -> Array:
        """(N, 2) centres of the top view's pixels in the scene frame [m], row by row."""
        (rows, columns), extent = self._shape, self._upper - self._lower
        x = self._lower[0] + (np.arange(columns) + 0.5) * extent[0] / columns
        y = self._upper[1] - (np.arange(rows) + 0.5) * extent[1] / rows
        return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)

    def _project_by_pose(
        self, image: Image, p_SQ: Array
    ) -> tuple[Array, float, tuple[int, ...], str]:
        assert self._pose is not None and self._intrinsics is not None
        found = self._pose.estimate(image)
        if not found.valid:
            raise InvalidInputError(f"the board was not found in the image: {found.reason}")
        X_CS = inverse(found.X_SC)
        p_CQ = transform_points(X_CS, np.column_stack([p_SQ, np.zeros(len(p_SQ))]))
        ahead = p_CQ[:, 2] >= NEAR_DISTANCE
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
    resolution: float = DEFAULT_PIXEL_SIZE,
) -> BoardPicture:
    """Rectifies one image to a top view; use `BoardRectifier` for successive images.

    Args:
        image: (H, W, 3) RGB.
        board, intrinsics, margin, resolution: see `BoardRectifier`.

    Raises:
        InvalidInputError: see `BoardRectifier.picture`.
    """
    rectifier = BoardRectifier(board, intrinsics, margin=margin, resolution=resolution)
    return rectifier.picture(image)


def _sample_image(image: Image, pixels: Array) -> Image:
    """(H, W, 3) colours of an image at pixels (H, W, 2), averaged over the area of each sample
    where these lie far apart.
    """
    step = np.concatenate([np.diff(pixels, axis=axis).reshape(-1, 2) for axis in (0, 1)])
    shrink = max(1, int(np.median(np.linalg.norm(step, axis=1))))
    if shrink > 1:
        height, width = (n // shrink * shrink for n in image.shape[:2])
        size = width // shrink, height // shrink
        image = np.asarray(
            cv2.resize(image[:height, :width], size, interpolation=cv2.INTER_AREA), np.uint8
        )
        pixels = (pixels + 0.5) / shrink - 0.5
    u, v = np.moveaxis(pixels.astype(np.float32), 2, 0)
    outside = (128, 128, 128)  # RGB of places outside the photo.
    return np.asarray(
        cv2.remap(
            image, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=outside
        )
    )


@dataclass(frozen=True, eq=False)
class SheetFit:
    """The sheet's fitted projection into an image.

    Attributes:
        H: (3, 3) homography from x and y of the scene frame [m] to undistorted image coordinates,
            which have their origin in the image's middle and half its diagonal as their unit.
        distortion: coefficient of the radius r from the middle: `r (1 + distortion r^2)`.
        middle: (2,) middle of the image [pixels].
        radius: half the image's diagonal [pixels].
        error: root mean square distance of the markers' corners from their places on the sheet [m].
        ids: ids of the used markers.
    """

    H: Array
    distortion: float
    middle: Array
    radius: float
    error: float
    ids: tuple[int, ...]

    def project(self, p_SQ: Array) -> Array:
        """(N, 2) pixels of points (N, 2) on the sheet [m]; far outside the image for invisible
        points.
        """
        return _project(self.H, self.distortion, p_SQ) * self.radius + self.middle


class SheetFinder:
    """Finds one board's sheet in images."""

    def __init__(self, board: Board) -> None:
        self._layout = board.layout
        self._detector = MarkerDetector(board.layout)

    def find(self, image: Bytes) -> SheetFit:
        """Finds the sheet in an image.

        Args:
            image: (H, W) or RGB (H, W, 3).

        Raises:
            InvalidInputError: the image does not show this board.
        """
        grey = grey_image(image)
        seen = self._detector.detect(grey)
        if not len(seen.index):
            reason = no_markers_reason(grey, self._layout, seen.candidates)
            raise InvalidInputError(f"the image shows {reason}; improve the light, or move closer")
        size = np.array(grey.shape[::-1], dtype=float)
        middle, radius = 0.5 * (size - 1.0), 0.5 * float(np.linalg.norm(size))
        p_SQ = self._layout.p_SQ[seen.index][..., :2]
        corners = (seen.corners - middle) / radius
        # At least 0.1 of a marker's side, as the homography has no distortion.
        tolerance = max(CORNER_TOLERANCE[0] / radius, 0.1 * float(side_lengths(corners).mean()))
        kept = np.ones(len(p_SQ), dtype=bool)
        if len(p_SQ) > 1:
            kept = consistent_markers(p_SQ, corners, tolerance)
        n, fit = len(kept), int(kept.sum())
        if fit < max(1, n / 2) or (n > 1 and fit < 2):
            raise InvalidInputError(f"the image shows {misplaced_reason(n, fit)}")
        if 2 * fit < len(self._layout.ids):
            self._require_no_foreign_markers(grey, fit)
        p_SQ, corners = p_SQ[kept].reshape(-1, 2), corners[kept].reshape(-1, 2)
        H, distortion = _fit_sheet(p_SQ, corners, fit, 1.0 / radius)
        residuals = _project(H, distortion, p_SQ) - corners
        scale = self._layout.side / float(side_lengths(corners.reshape(-1, 4, 2)).mean())
        error = scale * float(np.sqrt((residuals**2).sum(axis=1).mean()))
        # Fraction of a marker's side; with larger errors it is another board.
        if error > 0.05 * self._layout.side:
            raise InvalidInputError(
                "the image shows another board: the corners of its markers are off by"
                f" {1e3 * error:.1f} mm on average; are side and spacing right, and is the sheet"
                " flat?"
            )
        ids = tuple(int(i) for i in self._layout.ids[seen.index[kept]])
        return SheetFit(H, distortion, middle, radius, error, ids)

    def _require_no_foreign_markers(self, grey: Bytes, fit: int) -> None:
        """Rejects a sheet with more foreign markers than fitting ones, as boards of several sizes
        share a part of the first row.
        """
        layout = self._layout
        other = find_foreign_markers(grey, layout)
        if other is None or other.dictionary.lower() != layout.dictionary.lower():
            return
        foreign_markers = set(other.ids) - set(layout.ids.tolist())
        if len(foreign_markers) > fit:
            raise InvalidInputError(
                f"the image shows another board: {len(foreign_markers)} markers in sight have ids"
                f" above {layout.ids[-1]}, the last of this one; are columns and rows right?"
            )


def _fit_sheet(p_SQ: Array, corners: Array, markers: int, pixel: float) -> tuple[Array, float]:
    """Fits homography and distortion to corners (N, 2), robust against misplaced corners of half
    hidden markers.
    """
    H, _ = cv2.findHomography(p_SQ, corners, 0)
    if H is None:
        raise InvalidInputError("the visible part of the board does not determine its pose")

    def residuals(x: Array) -> Array:
        return (_project(_homography(x), float(x[8:].sum()), p_SQ) - corners).ravel()

    def fit(start: Array, limit: Array) -> Any:
        return least_squares(
            *(residuals, start),
            bounds=(-limit, limit),
            x_scale="jac",
            loss="soft_l1",
            f_scale=0.5 * pixel,  # standard deviation of a corner
        )

    plain = fit((H / H[2, 2]).ravel()[:8], np.full(8, np.inf))
    if markers >= 6:  # Fewer do not determine the distortion.
        # The distortion may shift an image corner by 0.3 of its distance from the middle.
        distorted = fit(np.append(plain.x, 0.0), np.append(np.full(8, np.inf), 0.3))
        # The distortion is used if it lowers the cost below this fraction.
        if distorted.cost < 0.5 * plain.cost:
            return _homography(distorted.x), float(distorted.x[8])
    return _homography(plain.x), 0.0


def _homography(x: Array) -> Array:
    return np.append(x[:8], 1.0).reshape(3, 3)


def _project(H: Array, distortion: float, p_SQ: Array) -> Array:
    q = np.column_stack([p_SQ, np.ones(len(p_SQ))]) @ H.T
    ahead = q[:, 2:] > 1e-3 * np.abs(q[:, 2]).max()
    flat = np.where(ahead, q[:, :2] / np.where(ahead, q[:, 2:], 1.0), 1e3)
    bent: Array = flat * (1.0 + distortion * (flat**2).sum(axis=1, keepdims=True))
    return bent


@dataclass(frozen=True, eq=False)
class BoardObservation:
    """The board in one frame.

    Attributes:
        picture: the top view; None if there is none.
        reason: why the view is missing or doubtful; "" if all is well.
    """

    picture: BoardPicture | None
    reason: str


def board_observations(
    source: FrameSource,
    rectifier: BoardRectifier,
    *,
    period: float = 1.0,
    stop: threading.Event | None = None,
) -> Iterator[BoardObservation]:
    """Observes the board repeatedly.

    Args:
        source: a live camera gives its newest frame each time, files give every frame. The caller
            closes it.
        rectifier: rectifier of the frames.
        period: least time between observations [s]; files are read without pauses.
        stop: set to end the observations, also during a wait.

    Yields:
        An observation per frame. If the board is not visible, the frame unreadable or the camera
        lost, `reason` says so and later observations may find the board again.
    """
    stop = stop or threading.Event()
    while not stop.is_set():
        started = time.monotonic()
        try:
            frame = source.read()
            if frame is None:
                return
            picture = rectifier.picture(frame.image)
            yield BoardObservation(picture, picture.note)
        except (CameraLost, InvalidInputError) as error:
            yield BoardObservation(None, str(error))
        if source.live:
            stop.wait(max(0.0, period - (time.monotonic() - started)))
