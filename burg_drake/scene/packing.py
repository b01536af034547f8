"""Packing of objects side by side, as densely as possible."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from burg_drake.core import Array, wrap_to_pi
from burg_drake.scene.object_shapes import ObjectShape
from burg_drake.scene.occupancy import OccupiedBoard, StandingObject, place_in_stable_pose
from burg_drake.scene.polygons import (
    SUPPORT_DIRECTIONS,
    Footprint,
    convex_polygon,
    next_vertices,
    polygon_area,
    previous_vertices,
    support_area,
)

PACKING_GAP = 3e-4
"""Metres between footprints, so that rounded poses do not overlap."""


def pack_objects(
    occupied: OccupiedBoard,
    objects: Sequence[tuple[ObjectShape, int]],
    quarter_turns: int = 0,
    needs_all: bool = False,
) -> list[StandingObject | None]:
    """Packs objects one after the other, and adds them to the board.

    Args:
        occupied: the board and the objects on it.
        objects: objects with the numbers of their stable poses.
        quarter_turns: rotation of the first object against the board, in turns of 90 degrees.
        needs_all: stop at the first object without room.

    Returns:
        The placed objects; None for objects without room.
    """
    max_yaws = 10  # Yaws tried for each object.
    found: list[StandingObject | None] = [None] * len(objects)
    for i, (shape, pose) in enumerate(objects):
        best, best_area = None, np.inf
        yaws = _aligned_yaws(shape.outline(pose).hull.corners, occupied.standing)
        first, count = (0, max_yaws) if occupied.standing else (quarter_turns, 1)
        for yaw in yaws[first : first + count]:
            turned = place_in_stable_pose(shape, pose, yaw)
            place, place_area = _best_place(occupied, turned)
            if place is not None and place_area < best_area - 1e-12:
                best, best_area = place, place_area
        if best is not None:
            occupied.add(best)
            found[i] = best
        elif needs_all:
            break
    return found


def packing_density(placed: Sequence[StandingObject]) -> float:
    """Share of the convex hull of all footprints that the footprints cover."""
    if not placed:
        return 0.0
    hull = convex_polygon(np.concatenate([standing.footprint.corners for standing in placed]))
    return sum(polygon_area(standing.footprint.corners) for standing in placed) / polygon_area(hull)


def _aligned_yaws(footprint: Array, others: Sequence[StandingObject]) -> list[float]:
    """Yaws that align the longest side of a footprint with the board's or the others' sides
    [rad]."""
    own = _side_headings(footprint)[0]
    towards = [k * np.pi / 2.0 for k in range(4)]
    for standing in others[::-1]:
        towards += [heading + np.pi for heading in _side_headings(standing.footprint.corners)]
    found: list[float] = []
    for heading in towards:
        yaw = float((heading - own) % (2.0 * np.pi))
        if all(abs(wrap_to_pi(yaw - other)) > 0.02 for other in found):
            found.append(yaw)
    return found


def _side_headings(polygon: Array) -> Array:
    """Headings of the longest sides of a polygon [rad]."""
    side_count = 3  # Longest sides of a footprint along which others are laid.
    along = next_vertices(polygon) - polygon
    longest = np.argsort(-np.hypot(along[:, 0], along[:, 1]), kind="stable")[:side_count]
    return np.asarray(np.arctan2(along[longest, 1], along[longest, 0]))


def _best_place(
    occupied: OccupiedBoard, turned: StandingObject
) -> tuple[StandingObject | None, float]:
    """The place with the smallest hull of all footprints, and the hull's area [m^2]."""
    low, high = -turned.footprint.low, occupied.size - turned.footprint.high
    if (low > high).any():
        return None, np.inf
    footprints = [standing.footprint for standing in occupied.standing]
    coarse = [standing.outline.coarse for standing in occupied.standing]
    points = (
        _touching_positions(turned.outline.coarse, coarse, low, high)
        if footprints
        else ((low + high) / 2.0)[None]
    )
    points = points[((points >= low) & (points <= high)).all(axis=1)]
    points = points[occupied.are_free(turned, points, PACKING_GAP)]
    if not len(points):
        return None, np.inf
    reaches = turned.footprint.support_values + points @ SUPPORT_DIRECTIONS.T
    for footprint in footprints:
        reaches = np.maximum(reaches, footprint.support_values)
    areas = support_area(reaches)
    best = int(areas.argmin())
    return turned.shifted(points[best]), float(areas[best])


def _touching_positions(
    footprint: Footprint, others: Sequence[Footprint], low: Array, high: Array
) -> Array:
    """Places (N, 2) of a footprint's origin at which it touches one or two other footprints."""
    around = [_grow_polygon(other.no_fit_polygon(footprint)) for other in others]
    starts = np.concatenate(around)
    ends = np.concatenate([next_vertices(polygon) for polygon in around])
    frame = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
    starts = np.concatenate([starts, frame])
    ends = np.concatenate([ends, next_vertices(frame)])
    along = ends - starts
    between = starts[None] - starts[:, None]
    turn = along[:, None, 0] * along[None, :, 1] - along[:, None, 1] * along[None, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (between[..., 0] * along[None, :, 1] - between[..., 1] * along[None, :, 0]) / turn
        u = (between[..., 0] * along[:, None, 1] - between[..., 1] * along[:, None, 0]) / turn
        cross = (t >= 0.0) & (t <= 1.0) & (u >= 0.0) & (u <= 1.0)
    i, j = np.nonzero(np.triu(cross, 1))
    return np.concatenate([starts, starts[i] + t[i, j, None] * along[i]])


def _grow_polygon(polygon: Array) -> Array:
    """A polygon grown by `PACKING_GAP` on all sides."""
    along = next_vertices(polygon) - polygon
    normal = np.empty_like(along)
    normal[:, 0], normal[:, 1] = along[:, 1], -along[:, 0]
    normal /= np.hypot(normal[:, 0], normal[:, 1])[:, None]
    before = previous_vertices(normal)
    cosine = before[:, 0] * normal[:, 0] + before[:, 1] * normal[:, 1]
    return polygon + PACKING_GAP * 1.001 * (before + normal) / (1.0 + cosine)[:, None]
