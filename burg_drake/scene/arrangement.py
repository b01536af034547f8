"""What is asked of a layout, and what comes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array, make_pose, rot_z, transform_points
from burg_drake.core.schema import Pose
from burg_drake.scene.convex_travel import ConvexBody
from burg_drake.scene.object_shapes import ObjectShape, ObjectShapes
from burg_drake.scene.polygons import convex_polygon, gap, turned
from burg_drake.scene.scene import Board, Instance

Layout = Literal["random", "wide", "close", "touching", "packed", "heap"]
"""`random`: anywhere on the board; `wide`: with room for an open hand's fingers in between; `close`
and `touching`: beside one another, a few millimetres apart or in contact; `packed`: as dense as it
gets; `heap`: in any orientation above a spot, to be dropped."""
LAYOUTS: tuple[Layout, ...] = get_args(Layout)

PoseChoice = Literal["probability", "uniform"]
"""Which of its stable poses an object gets: by their probabilities, or each as often."""

TRIES = 100
"""Random places that are tried for an object."""

HEADROOM = 0.005
"""Between an object and what hangs above it [m]."""


@dataclass(frozen=True, kw_only=True)
class Wanted:
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
class Standing:
    """An object at a place of the board.

    Attributes:
        shape: of the object.
        X_SO: (4, 4) pose in the scene frame.
        shadow: (N, 2) polygon that it covers [m].
        height: of its highest point above the board [m].
    """

    shape: ObjectShape
    X_SO: Array
    shadow: Array
    height: float

    def shifted(self, offset: Array) -> Standing:
        """The same one elsewhere: `offset` is (2,) [m]."""
        X_SO = make_pose(None, (*offset, 0.0)) @ self.X_SO
        return Standing(self.shape, X_SO, self.shadow + offset, self.height)

    def pieces(self) -> list[ConvexBody]:
        """What of it touches others, in the scene frame."""
        return [piece.moved(self.X_SO) for piece in self.shape.pieces]


def standing(shape: ObjectShape, pose: int, yaw: float) -> Standing:
    """An object in its k-th stable pose, turned by a yaw [rad] about its centre of mass, which is
    above the board's corner."""
    entry = shape.library.entry(shape.name)
    X_SO = make_pose(rot_z(yaw)) @ entry.X_SO(pose)
    return Standing(shape, X_SO, turned(shape.shadows[pose], yaw), shape.heights[pose])


class Occupied:
    """A board and what stands on it, seen from above."""

    def __init__(self, board: Board, obstacles: Sequence[Array] = ()) -> None:
        """Args:
        board: the board.
        obstacles: points (N, 3) of convex bodies that are there already, in S [m].
        """
        self.size = np.array(board.size)
        self.obstacles = [ConvexBody.from_points(points) for points in obstacles]
        self.standing: list[Standing] = []
        self._shadows = [
            (convex_polygon(body.vertices[:, :2]), *np.sort(body.vertices[:, 2])[[0, -1]])
            for body in self.obstacles
        ]

    def add(self, one: Standing) -> None:
        """Something stands there from now on."""
        self.standing.append(one)
        self._shadows.append((one.shadow, 0.0, one.height))

    def in_bounds(self, one: Standing) -> bool:
        """Whether nothing of it is beyond the board's edge."""
        return bool((one.shadow >= 0.0).all() and (one.shadow <= self.size).all())

    def is_free(self, one: Standing, least: float) -> bool:
        """Whether it is apart from all that stands there: shadows at least that far [m]."""
        lower, upper = one.shadow.min(axis=0) - least, one.shadow.max(axis=0) + least
        for shadow, bottom, top in self._shadows:
            if bottom > one.height + HEADROOM or top < 0.0:
                continue
            if (shadow.max(axis=0) < lower).any() or (shadow.min(axis=0) > upper).any():
                continue
            if gap(shadow, one.shadow) < least:
                return False
        return True

    def bodies(self) -> list[ConvexBody]:
        """All that is there, as convex bodies in S."""
        return [*self.obstacles, *(body for one in self.standing for body in one.pieces())]


def draw_pose(
    wanted: Wanted, shapes: ObjectShapes, rng: np.random.Generator, how: PoseChoice
) -> int:
    """The number of a stable pose.

    Raises:
        InvalidInputError: the one that is wanted does not exist.
    """
    entry = shapes.library.entry(wanted.object)
    if wanted.pose is not None:
        entry.X_SO(wanted.pose)
        return wanted.pose
    share = np.ones(len(entry.stable_poses))
    if how == "probability":
        share = np.array([pose.probability for pose in entry.stable_poses])
    if not share.sum() > 0.0:
        raise InvalidInputError(f"the stable poses of {wanted.object!r} have no probabilities")
    return int(rng.choice(len(share), p=share / share.sum()))


def random_place(one: Standing, size: Array, rng: np.random.Generator) -> Standing | None:
    """The same one anywhere on a board (2,) [m], evenly distributed; None if it is too large."""
    low, high = -one.shadow.min(axis=0), size - one.shadow.max(axis=0)
    if (low > high).any():
        return None
    return one.shifted(rng.uniform(low, high))


def instance(wanted: Wanted, X_SO: Array) -> Instance:
    """An instance whose pose can be read; it has no name of its own if that is its object's."""
    name = "" if wanted.name == wanted.object else wanted.name
    return Instance(name=name, object=wanted.object, X_SO=Pose.readable(X_SO))


def corners(shape: ObjectShape, X_SO: Array) -> Array:
    """Corners (N, 3) of an object's hull in S [m], to be an obstacle for others."""
    return transform_points(X_SO, shape.corners)
