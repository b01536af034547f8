"""What something covers of the board: a convex polygon that is asked about again and again."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from burg_drake.core import Array
from burg_drake.scene.arrangement.polygons import Sides, no_fit_polygon_of_sides, support_values


@dataclass(frozen=True, eq=False)
class Footprint:
    """A convex polygon. What follows from its corners is computed once, when it is first needed.

    Attributes:
        corners: (N, 2) counter-clockwise [m].
    """

    corners: Array

    @cached_property
    def low(self) -> Array:
        """The lower corner (2,) of the box around it."""
        lower: Array = self.corners.min(axis=0)
        return lower

    @cached_property
    def high(self) -> Array:
        """The upper corner (2,) of the box around it."""
        upper: Array = self.corners.max(axis=0)
        return upper

    @cached_property
    def middle(self) -> Array:
        """The mean (2,) of its corners."""
        center: Array = self.corners.mean(axis=0)
        return center

    @cached_property
    def reach(self) -> Array:
        """How far it reaches along `polygons.DIRECTIONS`."""
        return support_values(self.corners)

    @cached_property
    def sides(self) -> Sides:
        """Its sides."""
        return Sides.of(self.corners)

    @cached_property
    def opposite_sides(self) -> Sides:
        """Its sides when it is turned by half a turn about the origin."""
        return Sides.of(-self.corners)

    def forbids(self, moving: Footprint) -> Array:
        """Where another one's origin must not be, see `polygons.no_fit_polygon`."""
        return no_fit_polygon_of_sides(self.sides, moving.opposite_sides)
