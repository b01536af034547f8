"""The board, the pictures on it, and the station around it in the browser."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from burg_drake.core import Array, InvalidInputError, inverse, quaternion_from_rotation
from burg_drake.scene import Board
from burg_drake.station import Station, marker_grid
from burg_drake.ui.panel_parts import FIXED_COLOR


def sheet_picture(board: Board, *, markers: bool = True) -> NDArray[np.uint8]:
    """(H, W, 3) picture of the printed sheet from above, with its far edge at the top.

    White if the markers do not fit on the board.
    """
    scale = 1600 / max(board.size)  # Pixels per metre.
    width, height = (max(2, round(scale * side)) for side in board.size)
    gray = np.full((height, width), 252, dtype=np.uint8)
    if markers:
        try:
            x, y, black = marker_grid(board)
        except InvalidInputError:
            pass
        else:
            columns = np.clip(np.searchsorted(x, (np.arange(width) + 0.5) / scale) - 1, 0, None)
            rows = np.clip(np.searchsorted(y, (np.arange(height) + 0.5) / scale) - 1, 0, None)
            gray[black[columns][:, rows].T[::-1]] = 40
    gray[[0, 1, -1, -2]] = 200
    gray[:, [0, 1, -1, -2]] = 200
    return np.repeat(gray[..., None], 3, axis=2)


class BoardView:
    """Shows the board and the station's table and obstacles.

    Args:
        scene: API of viser.
        station: around the board.
    """

    def __init__(self, scene: viser.SceneApi, station: Station | None) -> None:
        self._scene = scene
        self._shown: tuple[Board, bool] | None = None
        if station is not None:
            self._show_station(station)

    def show(self, board: Board, *, markers: bool = True) -> None:
        """Shows a board in the browser."""
        if self._shown == (board, markers):
            return
        self._shown = board, markers
        width, height = board.size
        self._scene.add_image(
            "/board",
            sheet_picture(board, markers=markers),
            width,
            height,
            format="png",
            position=(width / 2.0, height / 2.0, -3e-4),  # below the objects
            wxyz=(0.0, 1.0, 0.0, 0.0),  # viser's pictures hang with y down
            cast_shadow=False,
        )

    def _show_station(self, station: Station) -> None:
        X_SW = inverse(station.document.X_WS.matrix())
        table = station.document.table
        X_WT = np.eye(4)
        X_WT[:3, 3] = *table.center, -table.size[2] / 2.0 - 2e-3  # below the objects
        self._box("/station/table", X_SW @ X_WT, table.size, (222, 216, 206))
        for name, obstacle in station.document.background.items():
            self._box(f"/station/{name}", X_SW @ obstacle.X_WB.matrix(), obstacle.size, FIXED_COLOR)

    def _box(
        self, name: str, X_SB: Array, size: tuple[float, ...], color: tuple[int, int, int]
    ) -> None:
        self._scene.add_box(
            name,
            color=color,
            dimensions=size,  # type: ignore[arg-type]
            position=X_SB[:3, 3],
            wxyz=quaternion_from_rotation(X_SB[:3, :3]),
            cast_shadow=False,
        )


@dataclass(frozen=True, eq=False)
class BoardOverlay:
    """A picture on the board.

    Attributes:
        pixels: (H, W, 3 or 4), the first row at the far edge.
        lower, upper: corners of the covered rectangle in S [m].
        opacity: 0 to 1.
    """

    pixels: NDArray[np.uint8]
    lower: tuple[float, float]
    upper: tuple[float, float]
    opacity: float = 1.0

    def rgba(self) -> NDArray[np.uint8]:
        """(H, W, 4) pixels with the opacity as alpha."""
        alpha = self.pixels[..., 3:] if self.pixels.shape[2] == 4 else np.uint8(255)
        faint = np.round(self.opacity * np.broadcast_to(alpha, (*self.pixels.shape[:2], 1)))
        return np.concatenate([self.pixels[..., :3], faint.astype(np.uint8)], axis=2)


class BoardLayers:
    """Shows pictures on the board.

    Args:
        scene: API of viser.
    """

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._shown: dict[str, tuple[BoardOverlay, Any]] = {}

    def show(self, name: str, sheet: BoardOverlay | None) -> None:
        """Shows a picture as layer `backdrop` or `reach`; None removes it."""
        # Metres from the plane on which objects stand; the board is below all layers.
        layer_heights = {"backdrop": -2e-4, "reach": -1e-4}
        shown = self._shown.get(name)
        if shown is not None and shown[0] is sheet:
            return
        if shown is not None:
            self._shown.pop(name)[1].remove()
        if sheet is None:
            return
        (x0, y0), (x1, y1) = sheet.lower, sheet.upper
        handle = self._scene.add_image(
            f"/layers/{name}",
            sheet.rgba(),
            x1 - x0,
            y1 - y0,
            format="png",
            position=((x0 + x1) / 2.0, (y0 + y1) / 2.0, layer_heights[name]),
            wxyz=(0.0, 1.0, 0.0, 0.0),  # viser's pictures hang with y down
            cast_shadow=False,
        )
        self._shown[name] = sheet, handle
