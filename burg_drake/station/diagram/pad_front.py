"""The flat front of a pad, by which a bed of springs can stand for its elastic volume."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import VolumeMesh
from scipy.spatial import ConvexHull, QhullError

from burg_drake.core import Array, transform_points

FLAT = 1e-5
"""What is no farther than this behind the foremost point belongs to the front [m]."""
SMALLEST_SHARE = 0.5
"""Of a pad's outline that its front has to have; less is an edge, or curved."""
CONVEX = 1.01
"""Volume of a pad's hull over that of the pad, at most."""


@dataclass(frozen=True, eq=False)
class PadFront:
    """The front of a pad on a link B: a plane in which the pad is pressed upon.

    Attributes:
        X_BP: (4, 4) frame P in the middle of the smallest rectangle about the front, with the axes
            x and y along its sides and z out of the pad.
        size: extents of the rectangle along x and y [m].
        area: of the front [m^2].
        stiffness: pressure over depth [N/m^3].
        thickness: of the pad, behind the front [m].
        corners: (M, 3) of the whole pad's convex hull, in P [m].
    """

    X_BP: Array
    size: tuple[float, float]
    area: float
    stiffness: float
    thickness: float
    corners: Array


def pad_front(
    X_BC: Array, volume: VolumeMesh, modulus: float, closing_B: Array, side_B: Array
) -> PadFront:
    """Finds the front of a pad, and how stiff the pad is there.

    The pressure of Drake's elastic volumes grows from 0 at the surface to the modulus at the
    vertex farthest inside; behind a front it grows evenly up to the first vertices inside.

    Args:
        X_BC: (4, 4) pose of the volume in the link.
        volume: of the pad, in C.
        modulus: hydroelastic modulus [Pa].
        closing_B: (3,) unit vector, in which the finger closes.
        side_B: (3,) unit vector across it, for the order of the axes of P.

    Raises:
        ValueError: there is no flat front, or the pad is not convex; tells in what way.
    """
    p_BV = transform_points(X_BC, np.array([volume.vertex(i) for i in range(_count(volume))]))
    hull = ConvexHull(p_BV)
    if hull.volume > CONVEX * volume.CalcVolume():
        raise ValueError("cannot be modelled by springs, as the pad is not convex")
    heights = p_BV @ closing_B
    other_B = np.cross(closing_B, side_B)
    flat = p_BV @ np.stack([side_B, other_B], axis=1)
    front = flat[heights > heights.max() - FLAT]
    outline = _hull_of(front)
    area, whole = (0.0 if o is None else _area(o) for o in (outline, _hull_of(flat)))
    if outline is None or area < SMALLEST_SHARE * whole:
        raise ValueError(
            f"has only {1e6 * area:.0f} mm2 of the pad's {1e6 * whole:.0f} mm2 facing the"
            " closing direction; the pad needs a flat front: use a box or a convex mesh"
        )
    R, low, high = _smallest_rectangle(outline)
    middle = (low + high) / 2 @ R
    X_BP = np.eye(4)
    X_BP[:3, 0], X_BP[:3, 1] = (
        np.stack([side_B, other_B]).T @ R[0],
        (np.stack([side_B, other_B]).T @ R[1]),
    )
    X_BP[:3, 2] = closing_B
    X_BP[:3, 3] = middle[0] * side_B + middle[1] * other_B + heights.max() * closing_B
    planes = hull.equations
    inside = -(p_BV @ planes[:, :3].T + planes[:, 3]).max(axis=1)
    within = inside > FLAT
    if not within.any():
        raise ValueError("has no inner vertex of the pad's volume mesh behind it")
    depth = heights.max() - heights
    first = np.flatnonzero(within)[np.argmin(depth[within])]
    corners = p_BV[hull.vertices]
    return PadFront(
        X_BP=X_BP,
        size=(float(high[0] - low[0]), float(high[1] - low[1])),
        area=float(area),
        stiffness=float(modulus * inside[first] / inside.max() / depth[first]),
        thickness=float(depth.max()),
        corners=np.asarray((corners - X_BP[:3, 3]) @ X_BP[:3, :3]),
    )


def _count(volume: VolumeMesh) -> int:
    return int(volume.num_vertices())


def _hull_of(points: Array) -> Array | None:
    """(N, 2) outline of points (M, 2), counter-clockwise; None if they lie on a line."""
    if len(points) < 3:
        return None
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        return None


def _area(outline: Array) -> float:
    x, y = outline.T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)


def _smallest_rectangle(outline: Array) -> tuple[Array, Array, Array]:
    """Axes (2, 2, one a row) of the smallest rectangle about an outline, and its lower and upper
    corners (2,) along them; of equal ones that which is turned least."""
    found = []
    for edge in np.roll(outline, -1, axis=0) - outline:
        angle = np.arctan2(edge[1], edge[0]) % (np.pi / 2)
        angle = angle - np.pi / 2 if angle > np.pi / 4 else angle
        R = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        along = outline @ R.T
        low, high = along.min(axis=0), along.max(axis=0)
        found.append((round(float((high - low).prod()), 12), abs(angle), (R, low, high)))
    return min(found, key=lambda one: one[:2])[2]
