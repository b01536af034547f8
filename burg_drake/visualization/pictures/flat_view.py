"""A parallel projection onto a flat picture: where points go in an SVG, and how deep they lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array


@dataclass(frozen=True, eq=False)
class FlatView:
    """A camera without perspective, whose picture is measured in SVG units.

    Attributes:
        R_WC: (3, 3) the camera's axes: x to the right, y down, z into the picture.
        scale: SVG units a metre.
        corner: (2,) what along the camera's x and y is at the picture's upper left [m].
        size: width and height [SVG units].
    """

    R_WC: Array
    scale: float
    corner: Array
    size: tuple[float, float]

    def places(self, p_WQ: Array) -> Array:
        """Where points (..., 3) in the world [m] are in the picture (..., 2) [SVG units]."""
        return (np.asarray(p_WQ) @ self.R_WC[:, :2] - self.corner) * self.scale

    def depths(self, p_WQ: Array) -> Array:
        """How far (...) points (..., 3) in the world [m] lie behind the picture [m]."""
        return np.asarray(p_WQ) @ self.R_WC[:, 2]


def fit_view(
    p_WQ: Array, R_WC: Array, width: float, height: float | None = None, margin: float = 6.0
) -> FlatView:
    """The largest view that shows all points in its middle.

    Args:
        p_WQ: (N, 3) points in the world [m]; at least one.
        R_WC: (3, 3) the camera's axes.
        width, height: of the picture [SVG units]; the height follows from the points if None.
        margin: that is left free on every side [SVG units].
    """
    seen = np.asarray(p_WQ) @ R_WC[:, :2]
    low, high = seen.min(axis=0), seen.max(axis=0)
    extent = np.maximum(high - low, 1e-6)
    scale = (width - 2 * margin) / extent[0]
    if height is None:
        height = float(np.ceil(scale * extent[1] + 2 * margin))
    else:
        scale = min(scale, (height - 2 * margin) / extent[1])
    corner = (low + high) / 2.0 - np.array([width, height]) / (2.0 * scale)
    return FlatView(R_WC, float(scale), corner, (width, height))


def path_data(places: Array, *, closed: bool = True, decimals: int = 1) -> str:
    """A polygon or line through places (N, 2) as the `d` of an SVG path."""
    corners = "L".join(f"{_short(x, decimals)} {_short(y, decimals)}" for x, y in places)
    return f"M{corners}{'Z' if closed else ''}"


def _short(value: float, decimals: int) -> str:
    text = f"{value:.{decimals}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text == "-0" else text
