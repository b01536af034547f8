"""What an arm reaches from above as an image, to be laid on the board like a sheet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from burg_drake.motion.workspace import ReachLayer
from burg_drake.visualization.style import map_colors


def reach_image(layer: ReachLayer, *, pixels: int = 1, opacity: float = 1.0) -> NDArray[np.uint8]:
    """The shares of the hand's turns as colours, from none to all.

    Args:
        layer: what is reached.
        pixels: along each side of a point's cell.
        opacity: 0 to 1, of all colours.

    Returns:
        (H, W, 4) red, green, blue, opacity; it covers the board, its first row along the upper edge
        of the sheet (largest y of S), its first column along the left one.
    """
    colors = np.empty((*layer.share.shape, 4))
    colors[..., :3] = map_colors(layer.share)
    colors[..., 3] = opacity
    bytes_ = np.round(255.0 * np.clip(colors[::-1], 0.0, 1.0)).astype(np.uint8)
    return np.ascontiguousarray(bytes_.repeat(pixels, axis=0).repeat(pixels, axis=1))
