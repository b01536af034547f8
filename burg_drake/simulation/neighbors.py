"""Which objects can take part in a trial; the others are locked in place, which saves their cost.

Objects, hand and target are bounded by upright prisms over the outline of their bounding boxes, so
that the choice does not change when the world is turned. An object takes part if its prism comes
close to the space that hand and target sweep on the way up, or to an object that takes part.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from burg_drake.core.frames import Array, transform_points

MARGIN = 0.03
"""Gap [m] beyond which an object is taken to be out of the trial."""


@dataclass(frozen=True, eq=False)
class Prism:
    """An upright prism over a convex outline.

    Attributes:
        outline: (N, 2) corners in the xy plane [m].
        normals: (N, 2) outward unit normals of the outline's edges.
        bottom, top: z of its ends [m].
    """

    outline: Array
    normals: Array
    bottom: float
    top: float

    def near(self, other: Prism) -> bool:
        """Whether the gap to another prism is below `MARGIN` along every edge normal and z."""
        if max(self.bottom - other.top, other.bottom - self.top) >= MARGIN:
            return False
        return max(self._gap(other), other._gap(self)) < MARGIN

    def _gap(self, other: Prism) -> float:
        ends = (self.outline @ self.normals.T).max(axis=0)
        starts = (other.outline @ self.normals.T).min(axis=0)
        return float((starts - ends).max())

    def raised(self, height: float) -> Prism:
        """The space that it sweeps when raised by `height` [m]."""
        return Prism(self.outline, self.normals, self.bottom, self.top + height)


def bounding_prism(lower: Array, upper: Array, X_WB: Array) -> Prism:
    """Prism around a box (corners `lower`, `upper` in B [m]) at `X_WB` (4, 4)."""
    corners = np.array(list(itertools.product(*zip(lower, upper, strict=True))))
    points = transform_points(X_WB, corners)
    hull = ConvexHull(points[:, :2])
    return Prism(
        points[hull.vertices, :2],
        hull.equations[:, :2],
        float(points[:, 2].min()),
        float(points[:, 2].max()),
    )


def taking_part(objects: dict[str, Prism], target: str, hand: Prism, rise: float) -> set[str]:
    """Names of the objects that a trial has to simulate.

    Args:
        objects: bounds of all free objects at the start.
        target: name of the grasped one.
        hand: bounds of the open hand at the grasp.
        rise: how far hand and target go up [m].
    """
    part, remaining = {target}, set(objects) - {target}
    front = [objects[target].raised(rise), hand.raised(rise)]
    while front:
        near = {name for name in remaining if any(objects[name].near(p) for p in front)}
        part |= near
        remaining -= near
        front = [objects[name] for name in near]
    return part
