"""What is known of one object in one view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array

Box = tuple[int, int, int, int]
"""Left column, top row, width, height [pixels]."""


@dataclass(frozen=True, eq=False)
class InstanceLabel:
    """An instance in a view.

    Its silhouette is all that the camera would see of it if it were alone, and if the image had no
    edges (up to one image size beyond each).

    Attributes:
        name: instance in the scene.
        object: of the library.
        number: in the label image.
        X_CO: (4, 4) object's frame in the camera's optical frame.
        visible_pixels: pixels that show it.
        silhouette_pixels: of its silhouette, within the image or not.
        visibility: the first as a share of the second, in [0, 1]; 0 without silhouette.
        visible_box: smallest one around the visible pixels; None if there are none.
        amodal_box: around the silhouette; it may reach beyond the image.
        amodal: (H, W) the part of the silhouette that lies within the image.
    """

    name: str
    object: str
    number: int
    X_CO: Array
    visible_pixels: int
    silhouette_pixels: int
    visibility: float
    visible_box: Box | None
    amodal_box: Box | None
    amodal: NDArray[np.bool_]


def box_of_mask(mask: NDArray[np.bool_]) -> Box | None:
    """The smallest box around the pixels of a mask (H, W) that are on; None if there are none."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return None
    left, top = int(columns[0]), int(rows[0])
    return left, top, int(columns[-1]) - left + 1, int(rows[-1]) - top + 1
