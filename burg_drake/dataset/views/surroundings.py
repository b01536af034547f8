"""What is around a camera: boxes that it cannot be in, and that hide what is behind them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from burg_drake.core import Array, Booleans, inverse, transform_points
from burg_drake.objects.library import ObjectEntry
from burg_drake.scene.document import Scene
from burg_drake.station.document import Station
from burg_drake.station.world import obstacle_boxes, table_box

SLACK = 1e-6
"""What touches a line at its very end is not in its way (share of the line)."""


@dataclass(frozen=True, eq=False)
class PlacedBox:
    """A box in the scene.

    Attributes:
        name: of what it is, or is around.
        X_SB: (4, 4) pose of its middle.
        half: (3,) half of its extents [m].
    """

    name: str
    X_SB: Array
    half: Array

    def contains(self, p_SQ: Array) -> bool:
        """Whether a point (3,) is in it."""
        p_BQ = transform_points(inverse(self.X_SB), p_SQ[None])[0]
        return bool((np.abs(p_BQ) < self.half).all())

    def hides(self, p_SC: Array, p_SQ: Array) -> Booleans:
        """(N,) whether it is between a point (3,) and points (N, 3): part of the line to them is in
        the box, by the slabs between its three pairs of faces."""
        X_BS = inverse(self.X_SB)
        start = transform_points(X_BS, p_SC[None])
        along = transform_points(X_BS, p_SQ) - start
        along = np.where(np.abs(along) < 1e-12, 1e-12, along)
        one, other = (-self.half - start) / along, (self.half - start) / along
        enters = np.minimum(one, other).max(axis=1)
        leaves = np.maximum(one, other).min(axis=1)
        return np.asarray((enters < leaves - SLACK) & (leaves > SLACK) & (enters < 1.0 - SLACK))


@dataclass(frozen=True, eq=False)
class ViewedScene:
    """A scene on a station, as far as views have to do with it.

    Attributes:
        scene, station: the two.
    """

    scene: Scene
    station: Station

    @cached_property
    def solids(self) -> tuple[PlacedBox, ...]:
        """Table and obstacles."""
        X_SW = inverse(self.station.document.X_WS.matrix())
        boxes = {"table": table_box(self.station), **obstacle_boxes(self.station)}
        return tuple(
            PlacedBox(name, X_SW @ box.X_WB, np.array(box.size) / 2) for name, box in boxes.items()
        )

    @cached_property
    def objects(self) -> tuple[PlacedBox, ...]:
        """The boxes around all instances, along the axes of each: free ones, then background."""
        return tuple(self._around(name) for name in (*self.scene.instances, *self.scene.background))

    @cached_property
    def p_SO(self) -> Array:
        """(N, 3) centres of what there is to see [m]: free instances, or the background if there
        are none."""
        seen = self.objects[: len(self.scene.instances)] or self.objects
        return np.array([box.X_SB[:3, 3] for box in seen]).reshape(-1, 3)

    def _around(self, name: str) -> PlacedBox:
        return box_around(name, self.scene.entry(name), self.scene.X_SO(name))


def box_around(name: str, entry: ObjectEntry, X_SO: Array) -> PlacedBox:
    """The box around an object of a library at a pose (4, 4), along its axes."""
    lower, upper = np.array(entry.lower), np.array(entry.upper)
    X_SB = X_SO.copy()
    X_SB[:3, 3] = transform_points(X_SO, 0.5 * (lower + upper)[None])[0]
    return PlacedBox(name, X_SB, 0.5 * (upper - lower))
