"""The fixed boxes of a station, as they stand around a scene."""

from __future__ import annotations

import itertools

import numpy as np

from burg_drake.core import Array, inverse, transform_points
from burg_drake.station.document.station_document import Station

CORNERS = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
"""Of a box whose extents are 1."""


def boxes_in_scene(station: Station) -> list[Array]:
    """(8, 3) corners of each of a station's fixed boxes, in the scene frame [m]."""
    X_SW = inverse(station.document.X_WS.matrix())
    return [
        transform_points(X_SW @ box.X_WB.matrix(), CORNERS * box.size)
        for box in station.document.background.values()
    ]
