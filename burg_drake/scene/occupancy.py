"""The occupied board: objects that stand on it, and free places for further ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, InvalidInputError, Pose, make_pose, rot_z
from burg_drake.scene.convex_sweep import ConvexShapes, contact_distances
from burg_drake.scene.object_shapes import ObjectShape, ObjectShapes, Outline
from burg_drake.scene.polygons import Footprint, convex_polygon, distances_from_polygon
from burg_drake.scene.scene_document import Board, Instance, PoseChoice

BOX_TOLERANCE = 1e-9
"""Metres that boxes must be farther apart than asked, because of rounding."""


@dataclass(frozen=True, kw_only=True)
class ObjectRequest:
    """An object to place.

    Attributes:
        name: name of the instance.
        object: name of the object in the library.
        pose: number of its stable pose; drawn if None. Not used in a heap.
    """

    name: str
    object: str
    pose: int | None = None


@dataclass(frozen=True)
class Arrangement:
    """Result of an arrangement.

    Attributes:
        instances: placed instances in the order of the requests.
        missing: names of objects without a place.
        tries: number of places tried.
    """

    instances: tuple[Instance, ...]
    missing: tuple[str, ...]
    tries: int


@dataclass(frozen=True, eq=False)
class StandingObject:
    """An object in a stable pose at a place on the board.

    Attributes:
        shape: shape of the object.
        pose: number of its stable pose.
        yaw: rotation about the vertical through its centre of mass [rad].
        offset: (2,) position of the centre of mass from the board's corner [m].
        outline: outline of the object on the board.
    """

    shape: ObjectShape
    pose: int
    yaw: float
    offset: Array
    outline: Outline

    @cached_property
    def X_SO(self) -> Array:
        """(4, 4) pose in the scene frame."""
        X_SO = make_pose(rot_z(self.yaw)) @ self.shape.X_SO(self.pose)
        X_SO[:2, 3] += self.offset
        return X_SO

    @property
    def footprint(self) -> Footprint:
        """Convex hull of the outline."""
        return self.outline.hull

    def shifted(self, offset: Array) -> StandingObject:
        """The object at another `offset` (2,) [m]."""
        outline = self.outline.moved(offset)
        return StandingObject(self.shape, self.pose, self.yaw, self.offset + offset, outline)

    @cached_property
    def pieces(self) -> ConvexShapes:
        """Convex shapes of its contact geometry in the scene frame."""
        return self.shape.pieces.moved(self.X_SO)


def place_in_stable_pose(shape: ObjectShape, pose: int, yaw: float) -> StandingObject:
    """Places an object in a stable pose, turned by a yaw [rad], with the centre of mass above the
    board's corner."""
    return StandingObject(shape, pose, yaw, np.zeros(2), shape.outline(pose).rotated(yaw))


class OccupiedBoard:
    """A board and the objects on it, seen from above."""

    def __init__(self, board: Board, obstacles: Sequence[Array] = ()) -> None:
        """Args:
        board: the board.
        obstacles: points (N, 3) in S of convex bodies to avoid [m].
        """
        self.size = np.array(board.size)
        self.obstacles = [ConvexShapes.of([p], [np.zeros((3, 3))]) for p in obstacles]
        self.standing: list[StandingObject] = []
        self._footprints: list[tuple[Footprint, float, float]] = []
        for p in obstacles:
            low, high = float(p[:, 2].min()), float(p[:, 2].max())
            self._footprints.append((Footprint(convex_polygon(p[:, :2])), low, high))

    def add(self, standing: StandingObject) -> None:
        """Adds an object to the board."""
        self.standing.append(standing)
        self._footprints.append((standing.footprint, 0.0, standing.outline.height))

    def in_bounds(self, standing: StandingObject) -> bool:
        """Whether an object is within the board's edges."""
        footprint = standing.footprint
        return bool((footprint.low >= 0.0).all() and (footprint.high <= self.size).all())

    def distance_range_in_bounds(
        self, standing: StandingObject, direction: Array
    ) -> tuple[float, float]:
        """Range of distances along a unit vector (2,) at which an object is within the board's
        edges [m]; empty if the first is larger than the second."""
        with np.errstate(divide="ignore", invalid="ignore"):
            to_low = -standing.footprint.low / direction
            to_high = (self.size - standing.footprint.high) / direction
        distances = np.sort([to_low, to_high], axis=0)
        return float(distances[0].max()), float(distances[1].min())

    def are_free(
        self, standing: StandingObject, offsets: Array, min_gap: float
    ) -> NDArray[np.bool_]:
        """Whether an object's outline, moved by offsets (N, 2) [m], is at least `min_gap` [m] away
        from all others (N,). Bodies that hang above it or are below the board do not count."""
        headroom = 0.005  # Metres between an object and one above it.
        free = np.ones(len(offsets), dtype=bool)
        low, high = offsets + standing.footprint.low, offsets + standing.footprint.high
        for footprint, bottom, top in self._footprints:
            if bottom <= standing.outline.height + headroom and top >= 0.0:
                beside = np.maximum(footprint.low - high, low - footprint.high).max(axis=1)
                near = np.flatnonzero(free & (beside < min_gap + BOX_TOLERANCE))
                if len(near):
                    around = footprint.no_fit_polygon(standing.footprint)
                    free[near] = distances_from_polygon(around, offsets[near]) >= min_gap
        return free

    def is_free(self, standing: StandingObject, offset: Array, min_gap: float) -> bool:
        """As `are_free`, for one offset (2,)."""
        return bool(self.are_free(standing, offset[None], min_gap)[0])

    def pieces(self, first: StandingObject) -> list[ConvexShapes]:
        """Contact shapes of all objects and obstacles in the scene frame, beginning with those of
        object `first`."""
        others = (standing.pieces for standing in self.standing if standing is not first)
        return [first.pieces, *others, *self.obstacles]


def free_distance(
    moving: ConvexShapes,
    still: Sequence[ConvexShapes],
    direction: Array,
    limit: float,
    stop_below: float = -np.inf,
) -> float:
    """Distance that shapes can be moved together along a unit vector (3,), at most `limit`, until
    they touch others [m]; some value below `stop_below` if the distance is below that."""
    for others in still:
        if limit < stop_below:
            break
        i, j = np.indices((len(moving), len(others))).reshape(2, -1)
        distances = contact_distances(
            moving, others, (i, j), direction, limit, stop_below=stop_below
        )
        limit = min(limit, float(distances.min()))
    return limit


def draw_pose(
    wanted: ObjectRequest, shapes: ObjectShapes, rng: np.random.Generator, how: PoseChoice
) -> int:
    """Draws the number of a stable pose.

    Raises:
        InvalidInputError: the requested pose does not exist.
    """
    entry = shapes.library.entry(wanted.object)
    if wanted.pose is not None:
        entry.X_SO(wanted.pose)
        return wanted.pose
    if how == "as_scanned":
        return entry.proposed_pose
    share = np.ones(len(entry.stable_poses))
    if how == "probability":
        share = np.array([pose.probability for pose in entry.stable_poses])
    if not share.sum() > 0.0:
        raise InvalidInputError(f"the stable poses of {wanted.object!r} have no probabilities")
    return int(rng.choice(len(share), p=share / share.sum()))


def random_place(
    occupied: OccupiedBoard,
    standing: StandingObject,
    rng: np.random.Generator,
    min_gap: float,
    tries: int,
) -> tuple[StandingObject | None, int]:
    """Draws uniformly distributed places on the board until one is free.

    Args:
        occupied: the board and the objects on it.
        standing: the object.
        rng: random generator.
        min_gap: least distance from other objects [m].
        tries: number of places to try.

    Returns:
        The object at the free place, or None; and the number of places tried.
    """
    low, high = -standing.footprint.low, occupied.size - standing.footprint.high
    if (low > high).any():
        return None, tries
    offsets = rng.uniform(low, high, (tries, 2))
    free = occupied.are_free(standing, offsets, min_gap)
    first = int(free.argmax())
    return (standing.shifted(offsets[first]), first + 1) if free[first] else (None, tries)


def to_instance(wanted: ObjectRequest, X_SO: Array) -> Instance:
    """Makes an instance with a readable pose. Its name is left out if it equals the object's."""
    name = "" if wanted.name == wanted.object else wanted.name
    return Instance(name=name, object=wanted.object, X_SO=Pose.readable(X_SO))
