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
    """An object that is to be placed.

    Attributes:
        name: of the instance.
        object: in the library.
        pose: number of its stable pose; drawn if None. Of no matter in a heap.
    """

    name: str
    object: str
    pose: int | None = None


@dataclass(frozen=True)
class Arrangement:
    """What found a place.

    Attributes:
        instances: in the order that was asked for.
        missing: names of those that found none.
        tries: places that were looked at.
    """

    instances: tuple[Instance, ...]
    missing: tuple[str, ...]
    tries: int


@dataclass(frozen=True, eq=False)
class StandingObject:
    """An object in a stable pose, at a place of the board.

    Attributes:
        shape: of the object.
        pose: number of its stable pose.
        yaw: by which it is turned about its centre of mass [rad].
        offset: (2,) of its centre of mass from the board's corner [m].
        outline: what it covers of the board.
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
        """The convex hull of what it covers."""
        return self.outline.hull

    def shifted(self, offset: Array) -> StandingObject:
        """The same one elsewhere: `offset` is (2,) [m]."""
        outline = self.outline.moved(offset)
        return StandingObject(self.shape, self.pose, self.yaw, self.offset + offset, outline)

    @cached_property
    def pieces(self) -> ConvexShapes:
        """What of it touches others, in the scene frame."""
        return self.shape.pieces.moved(self.X_SO)


def place_in_stable_pose(shape: ObjectShape, pose: int, yaw: float) -> StandingObject:
    """An object in its k-th stable pose, turned by a yaw [rad] about its centre of mass, which is
    above the board's corner."""
    return StandingObject(shape, pose, yaw, np.zeros(2), shape.outline(pose).rotated(yaw))


class OccupiedBoard:
    """A board and what stands on it, seen from above."""

    def __init__(self, board: Board, obstacles: Sequence[Array] = ()) -> None:
        """Args:
        board: the board.
        obstacles: points (N, 3) of convex bodies that are there already, in S [m].
        """
        self.size = np.array(board.size)
        self.obstacles = [ConvexShapes.of([p], [np.zeros((3, 3))]) for p in obstacles]
        self.standing: list[StandingObject] = []
        self._footprints: list[tuple[Footprint, float, float]] = []
        for p in obstacles:
            low, high = float(p[:, 2].min()), float(p[:, 2].max())
            self._footprints.append((Footprint(convex_polygon(p[:, :2])), low, high))

    def add(self, one: StandingObject) -> None:
        """Something stands there from now on."""
        self.standing.append(one)
        self._footprints.append((one.footprint, 0.0, one.outline.height))

    def in_bounds(self, one: StandingObject) -> bool:
        """Whether nothing of it is beyond the board's edge."""
        footprint = one.footprint
        return bool((footprint.low >= 0.0).all() and (footprint.high <= self.size).all())

    def exit_distances(self, one: StandingObject, direction: Array) -> tuple[float, float]:
        """After which ways along a unit vector (2,) nothing of it may be beyond the board's edge
        [m]: from the former to the latter, and never if that is less."""
        with np.errstate(divide="ignore", invalid="ignore"):
            to_low = -one.footprint.low / direction
            to_high = (self.size - one.footprint.high) / direction
        distances = np.sort([to_low, to_high], axis=0)
        return float(distances[0].max()), float(distances[1].min())

    def are_free(self, one: StandingObject, offsets: Array, least: float) -> NDArray[np.bool_]:
        """Whether what it covers, moved by offsets (N, 2) [m], is at least that far [m] from all
        that is there, (N,); what hangs above it and what is below the board is not in the way."""
        headroom = 0.005  # Metres between an object and one above it.
        free = np.ones(len(offsets), dtype=bool)
        low, high = offsets + one.footprint.low, offsets + one.footprint.high
        for footprint, bottom, top in self._footprints:
            if bottom <= one.outline.height + headroom and top >= 0.0:
                beside = np.maximum(footprint.low - high, low - footprint.high).max(axis=1)
                near = np.flatnonzero(free & (beside < least + BOX_TOLERANCE))
                if len(near):
                    around = footprint.no_fit_polygon(one.footprint)
                    free[near] = distances_from_polygon(around, offsets[near]) >= least
        return free

    def is_free(self, one: StandingObject, offset: Array, least: float) -> bool:
        """The same of one offset (2,)."""
        return bool(self.are_free(one, offset[None], least)[0])

    def pieces(self, first: StandingObject) -> list[ConvexShapes]:
        """What of all that is there touches others, in the scene frame; one of them comes first."""
        others = (one.pieces for one in self.standing if one is not first)
        return [first.pieces, *others, *self.obstacles]


def free_distance(
    moving: ConvexShapes,
    still: Sequence[ConvexShapes],
    direction: Array,
    limit: float,
    stop_below: float = -np.inf,
) -> float:
    """How far shapes can be moved together along a unit vector (3,), at most `limit`, until they
    touch others [m]; anything shorter than `stop_below`, once that is known to be too far."""
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
    """The number of a stable pose.

    Raises:
        InvalidInputError: the one that is wanted does not exist.
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
    occupied: OccupiedBoard, one: StandingObject, rng: np.random.Generator, least: float, tries: int
) -> tuple[StandingObject | None, int]:
    """Draws places all over the board, evenly distributed, until one is free.

    Args:
        occupied: the board and what stands there.
        one: the object.
        rng: draws.
        least: that it has to be away from others [m].
        tries: places to look at.

    Returns:
        The object there, or None; and the number of places that were looked at.
    """
    low, high = -one.footprint.low, occupied.size - one.footprint.high
    if (low > high).any():
        return None, tries
    offsets = rng.uniform(low, high, (tries, 2))
    free = occupied.are_free(one, offsets, least)
    first = int(free.argmax())
    return (one.shifted(offsets[first]), first + 1) if free[first] else (None, tries)


def to_instance(wanted: ObjectRequest, X_SO: Array) -> Instance:
    """An instance whose pose can be read; it has no name of its own if that is its object's."""
    name = "" if wanted.name == wanted.object else wanted.name
    return Instance(name=name, object=wanted.object, X_SO=Pose.readable(X_SO))
