"""Pictures that lie on the board: what the arm reaches, and a photo of the real board."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

HEIGHTS = {"backdrop": -2e-4, "reach": -1e-4}
"""By name: how far each is above the plane on which objects stand [m]; the board is below all."""


@dataclass(frozen=True, eq=False)
class BoardOverlay:
    """A picture that lies on the board.

    Attributes:
        pixels: (H, W, 3 or 4) its first row along the far edge.
        lower, upper: corners of what it covers in S [m].
        opacity: 0 to 1.
    """

    pixels: NDArray[np.uint8]
    lower: tuple[float, float]
    upper: tuple[float, float]
    opacity: float = 1.0

    def rgba(self) -> NDArray[np.uint8]:
        """(H, W, 4) with its opacity."""
        alpha = self.pixels[..., 3:] if self.pixels.shape[2] == 4 else np.uint8(255)
        faint = np.round(self.opacity * np.broadcast_to(alpha, (*self.pixels.shape[:2], 1)))
        return np.concatenate([self.pixels[..., :3], faint.astype(np.uint8)], axis=2)


class BoardLayers:
    """Shows pictures on the board.

    Args:
        scene: of viser.
    """

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._shown: dict[str, tuple[BoardOverlay, Any]] = {}

    def show(self, name: str, sheet: BoardOverlay | None) -> None:
        """Brings one of `HEIGHTS` to a picture, or to none."""
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
            position=((x0 + x1) / 2.0, (y0 + y1) / 2.0, HEIGHTS[name]),
            wxyz=(0.0, 1.0, 0.0, 0.0),  # viser's pictures hang with y down
            cast_shadow=False,
        )
        self._shown[name] = sheet, handle
