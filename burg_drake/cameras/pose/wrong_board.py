"""Detect that a sheet differs from the board's document although its markers fit."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.cameras.pose.edge_measurement import MIN_VISIBLE_DEPTH
from burg_drake.cameras.pose.marker_detection import (
    MAX_BIT_CORRECTION,
    MAX_BORDER_ERRORS,
    format_ids,
    read_cells,
)
from burg_drake.core import Array, Bytes, Indices, Single
from burg_drake.scene import Board, marker_dictionary

SIDE_DIRECTIONS = np.array([[0.0, 1.0], [1.0, 0.0], [0.0, -1.0], [-1.0, 0.0]])
"""From a marker's middle to its sides."""
CORNER_DIRECTIONS = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
"""From a marker's middle to its corners, in the layout's order."""


class WrongBoardCheck:
    """Detects signs of another board in images of one board by one camera.

    Args:
        board: of the document.
        intrinsics: of the camera.
        scale: size of the print relative to the document along x and y.
    """

    def __init__(self, board: Board, intrinsics: Intrinsics, scale: tuple[float, float]) -> None:
        layout = board.layout
        self._layout, self._intrinsics = layout, intrinsics
        self._columns = len(np.unique(np.round(layout.p_SQ[:, 0, 0], 9)))
        self._rows = len(layout.ids) // self._columns
        self._half_side = 0.5 * layout.side * np.array(scale)
        pitch = layout.side + board.markers.spacing
        row, column = np.mgrid[-1 : self._rows + 1, -1 : self._columns + 1]
        ring = (row < 0) | (row == self._rows) | (column < 0) | (column == self._columns)
        first = layout.p_SQ[0].mean(axis=0)[:2]
        self._outer_places = (first + pitch * np.stack([column, -row], axis=-1)[ring]) * scale
        self._marker_places = layout.p_SQ.mean(axis=1)[:, :2] * scale
        last_pixel = intrinsics.width - 1, intrinsics.height - 1
        corners = np.array([[0, 0], [0, 1], [1, 0], [1, 1]]) * last_pixel
        slopes = (intrinsics.undistort(corners) - intrinsics.center) / intrinsics.focal
        # Largest slope of a used ray: 2 % more than at the image's corners.
        self._max_slope = 1.02 * float(np.linalg.norm(slopes, axis=1).max())
        cell, gap = 1.0 / layout.cells, board.markers.spacing / layout.side
        # Middles of the border's cells, and the white beside them, in half sides.
        self._border_offsets = np.concatenate(
            [(1.0 - cell) * SIDE_DIRECTIONS, (1.0 + min(cell, gap)) * SIDE_DIRECTIONS]
        )
        # Points of a place that must be blank; the outer ones are on its border.
        middles = np.linspace(cell - 1.0, 1.0 - cell, 4)
        self._blank_offsets = np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2)

    def describe_foreign_markers(self, grey: Bytes, light: Single, X_SC: Array) -> str:
        """Describes markers around the grid, where the document has none.

        Args:
            grey: (H, W) image.
            light: (H, W) the same in linear light.
            X_SC: (4, 4) pose that fits the markers.

        Returns:
            A message, empty if there are none.
        """
        min_foreign = 2  # Markers outside the document's grid that prove another board.
        at, seen = self._project_places(X_SC, self._outer_places, self._border_offsets)
        if not seen.any():
            return ""
        values = _sample_light(light, at[seen])
        # Sides on which the border is darker than 0.6 of the light of the white frame.
        dark_sides = (values[:, :4] < 0.6 * values[:, 4:]).sum(axis=1)
        suspects = self._outer_places[seen][dark_sides >= 3]
        ids = self._read_ids(grey, X_SC, suspects) if len(suspects) >= min_foreign else []
        if len(ids) < min_foreign:
            return ""
        return (
            f"another board: markers with ids {format_ids(ids)} lie next to those of the document,"
            f" which has {self._columns} x {self._rows} from {self._layout.ids[0]} to"
            f" {self._layout.ids[-1]}; are count and first_id right?"
        )

    def describe_blank_line(self, light: Single, X_SC: Array, used: Indices) -> str:
        """Describes a row or column that should have markers but is blank paper.

        Args:
            light, X_SC: see `describe_foreign_markers`.
            used: markers that were seen, as indices of the layout's.

        Returns:
            A message, empty if there is none.
        """
        rows, columns = np.divmod(used, self._columns)
        for across, lines, count in ((True, rows, self._rows), (False, columns, self._columns)):
            for line in (lines.min() - 1, lines.max() + 1):
                if 0 <= line < count and self._is_blank(light, X_SC, used, across, line):
                    return self._blank_line_reason(
                        across, int(line), int(lines.min()), int(lines.max())
                    )
        return ""

    def _is_blank(
        self,
        light: Single,
        X_SC: Array,
        used: Indices,
        across: bool,
        line: int,
    ) -> bool:
        """Whether all visible marker places of a row or column are as light as blank paper."""
        max_difference = 0.35  # Fraction of the light of paper nearby.
        every = np.arange(len(self._marker_places)).reshape(self._rows, self._columns)
        which = every[line] if across else every[:, line]
        at, seen = self._project_places(X_SC, self._marker_places[which], self._blank_offsets)
        if seen.sum() < min(3, len(which)):  # Visible places of a row or column, or all of them.
            return False
        values = _sample_light(light, at[seen])
        if (np.ptp(values, axis=1) > 2.0 * max_difference * values.max(axis=1)).any():
            return False
        white, in_image = self._project_places(
            X_SC, self._marker_places[used], self._border_offsets[4:]
        )
        if not in_image.any():
            return False
        paper = np.median(_sample_light(light, white[in_image]), axis=1)
        # As light is uneven, compare with the paper beside the nearest visible marker.
        offset = self._marker_places[which][seen][:, None] - self._marker_places[used][in_image]
        nearest = paper[(offset**2).sum(axis=2).argmin(axis=1)]
        return bool((np.abs(values - nearest[:, None]) < max_difference * nearest[:, None]).all())

    def _blank_line_reason(self, across: bool, line: int, first: int, last: int) -> str:
        names = ("row", "from the top") if across else ("column", "from the left")
        looks = ""
        if across:
            looks = (
                f" with count [{self._columns}, {last - first + 1}] and first_id"
                f" {self._layout.ids[first * self._columns]}"
            )
        return (
            f"{names[0]} {line + 1} of markers {names[1]} is blank paper: is it covered, or is it"
            f" another board{looks}?"
        )

    def _project_places(self, X_SC: Array, middles: Array, offsets: Array) -> tuple[Array, Any]:
        """Pixels (N, M, 2) of points around places on the sheet, and (N,) whether all points of a
        place are in the image.

        Args:
            X_SC: (4, 4).
            middles: (N, 2) middles of the places [m].
            offsets: (M, 2) of the points [half sides of a marker].
        """
        p_S = np.zeros((len(middles), len(offsets), 3))
        p_S[..., :2] = middles[:, None] + offsets * self._half_side
        p_C = (p_S - X_SC[:3, 3]) @ X_SC[:3, :3]
        z = np.maximum(p_C[..., 2], MIN_VISIBLE_DEPTH)
        seen = (p_C[..., 2] > MIN_VISIBLE_DEPTH) & (
            np.hypot(p_C[..., 0], p_C[..., 1]) < self._max_slope * z
        )
        at = self._intrinsics.project(np.where(seen[..., None], p_C, [0.0, 0.0, 1.0]))
        limit = [self._intrinsics.width - 1, self._intrinsics.height - 1]
        seen &= ((at >= 0.0) & (at <= limit)).all(axis=2)
        return at, seen.all(axis=1)

    def _read_ids(self, grey: Bytes, X_SC: Array, middles: Array) -> list[int]:
        """Ids of the upright markers at places (N, 2)."""
        at, _ = self._project_places(X_SC, middles, CORNER_DIRECTIONS)
        black, _ = read_cells(grey, at, self._layout.cells)
        border = np.pad(np.zeros((self._layout.cells - 2,) * 2, bool), 1, constant_values=True)
        dictionary = marker_dictionary(self._layout.dictionary)
        ids = set()
        for cells in black[(~black[:, border]).mean(axis=1) <= MAX_BORDER_ERRORS]:
            bits = np.ascontiguousarray(~cells[1:-1, 1:-1], dtype=np.uint8)
            found, number, turns = dictionary.identify(bits, MAX_BIT_CORRECTION)
            if found and turns == 0:
                ids.add(int(number))
        return sorted(ids)


def _sample_light(light: Single, at: Array) -> Array:
    """(N, M) light at pixels (N, M, 2), bilinear."""

    u, v = np.moveaxis(at.astype(np.float32), 2, 0)
    return np.asarray(cv2.remap(light, u, v, cv2.INTER_LINEAR), dtype=float)
