"""What stands on the board and is no object of the scene: evidence that none of them explains."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.placement.alignment import (
    Aligner,
    PinholeView,
    sample_nearest,
    window_slices,
)
from burg_drake.cameras.placement.candidates import Placed
from burg_drake.cameras.placement.document import ExtraObject
from burg_drake.cameras.placement.search import RANGE
from burg_drake.core import Array, transform_points

CERTAIN = 0.5
"""Evidence from which on something stands in a pixel."""
MARGIN = 6e-3
"""How far beside an object's silhouette nothing is extra: errors of its place, blur [m]."""
THICK = 0.012
"""Width of the least thing that is told; what is thinner is an edge that was not explained [m]."""
TOGETHER = 0.02
"""What is nearer to each other than this is one thing [m]."""
MAX_HIDDEN_EXTENT = 0.15
"""Of the board behind an object, within which a thing's foot is looked for [m]."""
LEAST_AREA = 5e-4
"""Area that it covers at least, as if it were flat on the board [m²]."""


def extra_objects(
    aligner: Aligner, placed: Iterable[Placed], p_SR: Sequence[Array] = ()
) -> tuple[ExtraObject, ...]:
    """What none of the objects explains, the largest first.

    Args:
        aligner: of the image.
        placed: all objects that were found, where they are.
        p_SR: (3,) places where another object of the scene may stand that was not found anywhere.
            Nothing there counts, as it may be that one.
    """
    view, placed = aligner.view, list(placed)
    pitch = _pixels_per_metre(view)
    stands = aligner.evidence > CERTAIN
    for shape, q in placed:
        window = view.window(shape, q, MARGIN * pitch + 2.0)
        mask = np.isfinite(view.buffer(shape, q, window)).astype(np.uint8)
        size = 2 * round(MARGIN * pitch) + 1
        stands[window_slices(window)] &= cv2.dilate(mask, np.ones((size, size), np.uint8)) == 0
    size = max(2 * round(THICK * pitch / 2) + 1, 3)
    disk = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    stands = cv2.morphologyEx(stands.astype(np.uint8), cv2.MORPH_OPEN, disk)
    size = 2 * round(TOGETHER * pitch / 2) + 1
    count, labels = cv2.connectedComponents(cv2.dilate(stands, np.ones((size, size), np.uint8)))
    hidden = _HiddenBoard(aligner, placed)
    found = [_described(view, (labels == k) & (stands > 0), hidden) for k in range(1, count)]
    large = [
        (area, extra)
        for area, extra in found
        if area > LEAST_AREA and not any(_reaches(extra, p) for p in p_SR)
    ]
    return tuple(extra for _, extra in sorted(large, key=lambda f: -f[0]))


def _reaches(extra: ExtraObject, p_SR: Array) -> bool:
    """Whether a thing is where an object is looked for whose place this is."""
    off = float(np.hypot(*(np.array(extra.position) - p_SR[:2])))
    return off < RANGE + extra.width / 2.0


class _HiddenBoard:
    """Where things may stand behind objects that were found."""

    def __init__(self, aligner: Aligner, placed: list[Placed]) -> None:
        self._view = aligner.view
        self._covered = np.isfinite(self._view.depth(placed)) | (aligner.evidence > CERTAIN)
        corners = (transform_points(s.displacement(q), s.p_SV)[:, :2] for s, q in placed)
        self._feet = [cv2.convexHull(p.astype(np.float32)) for p in corners]

    def extent(self, start: Array, toward: Array) -> float:
        """How far from a point of the board (2,) the camera does not see the board, nor does an
        object stand there, in a direction (2,) [m]."""
        p_S = start + np.arange(MARGIN, MAX_HIDDEN_EXTENT, MARGIN / 2)[:, None] * toward
        _, pixels = self._view.project(np.column_stack([p_S, np.zeros(len(p_S))]))
        hidden = sample_nearest(self._covered, pixels, False).astype(bool)
        on_foot = [any(cv2.pointPolygonTest(f, p, False) >= 0 for f in self._feet) for p in p_S]
        return MARGIN / 2 * int(np.argmin(np.append(hidden & ~np.array(on_foot), False)))


def _described(
    view: PinholeView, mask: NDArray[np.bool_], hidden: _HiddenBoard
) -> tuple[float, ExtraObject]:
    """The area on the board behind a region of the image [m²], and what stands there.

    A thing hides the board behind it: it stands at the near end of that, and is as deep as wide. If
    an object hides the near end, it is in the middle of where that may be.
    """
    row, column = np.nonzero(mask)
    p_S = _on_the_board(view, np.stack([column, row], axis=-1).astype(float))
    area = float(_pixel_area(view, p_S).sum())
    arm = p_S - view.X_SC[:2, 3]
    away = arm.mean(axis=0) / max(float(np.linalg.norm(arm.mean(axis=0))), 1e-9)
    across = np.array([-away[1], away[0]])
    deep, side = arm @ away, arm @ across
    near = float(np.quantile(deep, 0.02))
    if near < THICK:  # the camera looks straight down on it
        return area, _extra(p_S.mean(axis=0), 2.0 * float(np.sqrt(area / np.pi)))
    # seen from above the camera's foot, the hidden board widens like a shadow
    left, right = np.quantile(side / np.maximum(deep, 1e-3), [0.02, 0.98]).tolist()
    aside = away + (left + right) / 2 * across
    near -= hidden.extent(view.X_SC[:2, 3] + near * aside, -away) / 2.0
    width = max((right - left) * near, THICK)
    middle = view.X_SC[:2, 3] + (near + width / 2) * aside
    return area, _extra(middle, width)


def _extra(position: Array, width: float) -> ExtraObject:
    x, y = np.round(position, 4).tolist()
    return ExtraObject(position=(x, y), width=round(width, 4))


def _on_the_board(view: PinholeView, pixels: Array) -> Array:
    """(N, 2) points of the board that image points (N, 2) show."""
    H_pixel_S = view.K @ view.X_CS[:3][:, [0, 1, 3]]
    p = np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(H_pixel_S).T
    return np.asarray(p[:, :2] / p[:, 2:])


def _pixel_area(view: PinholeView, p_S: Array) -> Array:
    """(N,) area of the board that a pixel covers at points (N, 2) [m²]."""
    J = view.jacobian(np.column_stack([p_S, np.zeros(len(p_S))]))[:, :, :2]
    return np.asarray(1.0 / np.maximum(np.abs(np.linalg.det(J)), 1e-9))


def _pixels_per_metre(view: PinholeView) -> float:
    """Of the board, in the middle of the image, the root of both ways."""
    middle = _on_the_board(view, np.array([view.size]) / 2.0)
    return float(_pixel_area(view, middle)[0] ** -0.5)
