"""The hand on its straight ways to a grasp and up from it, for many grasps, without the arm.

A way is judged as a whole, not at samples: what a convex part sweeps along a straight way is convex
(`motion.swept_shapes`), so that one overlap and one distance tell whether the way is free, and how
far from everything it stays.

Nothing here depends on what else is in a batch, not in its last bit: see `grasping.convex`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.errors import UnknownNameError, nearest
from burg_drake.core.frames import Array, check_pose, make_pose
from burg_drake.grasping.body import Body
from burg_drake.grasping.screen import HandScreen
from burg_drake.motion.hand_parts import is_symmetric, read_hand
from burg_drake.motion.swept_shapes import swept_body, swept_shape
from burg_drake.motion.way import deepest_on_way
from burg_drake.scene.scene import Scene
from burg_drake.station.diagram import build_station_diagram
from burg_drake.station.grasp_motion import GraspMotion
from burg_drake.station.station import Station

AT_REST = 1e-3
"""How much deeper than at rest an object may get into what it touches, when it is lifted [m]: at
rest it lies on the table or leans on others, and shapes overlap a little where they touch."""

STEP = 1e-3
"""Step at which the lift of an object past what it already touches is looked at [m]."""

UP = np.array((0.0, 0.0, 1.0))


@dataclass(frozen=True, eq=False)
class Sweep:
    """What is in the way of N hands.

    Attributes:
        free: (N,) whether nothing is.
        blocker: (N,) name of the body that is; "" where the way is free.
        clearance: (N,) smallest signed distance on the way [m]. Where it is free, that of the hand
            from other bodies: a lower bound, exact where no cylinder is swept across its axis (see
            `swept_shapes.SIDES`). Where not, minus the depth of the overlap with the blocker.
        at: (N,) how far from the grasp that depth is met [m]; NaN where the way is free, or the
            overlap too short to be found.
    """

    free: NDArray[np.bool_]
    blocker: NDArray[np.str_]
    clearance: Array
    at: Array

    def __len__(self) -> int:
        return len(self.free)


class HandSweep:
    """Sweeps a station's hand through one scene; objects stand where the document places them.

    Args:
        scene: what stands there.
        station: whose hand it is.
        motion: the ways.

    Attributes:
        symmetric: whether the hand with its fingers swapped occupies the same space.

    Raises:
        InvalidInputError: the diagram cannot be built, or a collision geometry is of a shape that
            the hand's screen does not know.
    """

    def __init__(self, scene: Scene, station: Station, motion: GraspMotion) -> None:
        self._standoff, self._height = motion.standoff, motion.lift_height
        diagram = build_station_diagram(scene, station, robot="hand")
        self._instances = tuple(diagram.free)
        self._order = ("table", *sorted(diagram.fixed), *sorted(diagram.free))
        self._parts, self._bodies = read_hand(diagram)
        self.symmetric = is_symmetric(self._parts)
        shapes = [shape for part in self._parts for shape in part.shapes]
        swept = [s for shape in shapes for s in swept_shape(shape, -motion.standoff * UP)]
        self._open = HandScreen(shapes, self._bodies)
        self._approach = HandScreen(swept, self._bodies)
        self._below: dict[float, dict[str, Body]] = {}
        self._lifts: dict[tuple[str, float], list[HandScreen]] = {}
        self._still = [HandScreen(part.shapes, self._bodies) for part in self._parts]
        self._rises: dict[tuple[str, float], _Blocked | None] = {}

    def approach(self, instance: str, X_WG: Array) -> Sweep:
        """The open hand on its way from the pregrasp to the grasp, both included.

        Args:
            instance: the target's name in the scene, which decides where several bodies are in the
                way; "" if there is none.
            X_WG: (N, 4, 4) grasps in the world.

        Raises:
            UnknownNameError: there is no such instance.
            InvalidInputError: `X_WG` are not poses.
        """
        X_WG = self._checked(instance, X_WG)
        order = [*([instance] if instance else ()), *self._others(instance)]
        names = self._approach.deepest(X_WG, order)[0]
        clearance, at = np.empty(len(X_WG)), np.full(len(X_WG), np.nan)
        free, hit = np.flatnonzero(names == ""), np.flatnonzero(names != "")
        clearance[free] = self._approach.nearest(X_WG[free])[1]
        back_W = -X_WG[hit, :3, 2]
        depth, at[hit] = deepest_on_way(self._open, X_WG[hit], names[hit], back_W, self._standoff)
        clearance[hit] = -depth
        return Sweep(names == "", names.astype(np.str_), clearance, at)

    def lift(self, instance: str, X_WG: Array, width: Array, height: float | None = None) -> Sweep:
        """The hand with the target in it on its way up.

        Hand and fingers count against all but the target, and the target against all others. The
        target's way does not depend on the grasp: where the hand is free and the target is not,
        what is in the target's way is the blocker.

        Args:
            instance: the target's name in the scene; "" if the hand is empty.
            X_WG: (N, 4, 4) grasps in the world.
            width: (N,) distance between the pads once they hold the target [m]; the hand is open
                where it is NaN.
            height: how far it goes [m]; by the whole lift if None.

        Raises:
            UnknownNameError: there is no such instance.
            InvalidInputError: `X_WG` are not poses.
        """
        X_WG, others = self._checked(instance, X_WG), self._others(instance)
        height = self._height if height is None else height
        placed = [part.placed(X_WG, np.asarray(width, float)) for part in self._parts]
        moves = list(zip(self._lift_screens(instance, height), placed, strict=True))
        ranks = np.array([_ranks(screen.deepest(X, others)[0], others) for screen, X in moves])
        names = np.array([*others, ""], dtype=object)[ranks.min(axis=0)]
        decisive = ranks.argmin(axis=0)
        clearance, at = np.full(len(X_WG), np.inf), np.full(len(X_WG), np.nan)
        free = np.flatnonzero(names == "")
        for k, (screen, X) in enumerate(moves):
            clearance[free] = np.minimum(clearance[free], screen.nearest(X[free])[1])
            hit = np.flatnonzero((names != "") & (decisive == k))
            up_W = np.broadcast_to(UP, (len(hit), 3))
            still = self._still[k]
            depth, at[hit] = deepest_on_way(still, X[hit], names[hit], up_W, height)
            clearance[hit] = -depth
        if instance and (blocked := self._rise(instance, height)) is not None:
            names[free], clearance[free], at[free] = blocked.by, -blocked.depth, blocked.at
        return Sweep(names == "", names.astype(np.str_), clearance, at)

    def _checked(self, instance: str, X_WG: Array) -> Array:
        if instance and instance not in self._instances:
            raise UnknownNameError(
                f"there is no instance {instance!r}; {nearest(instance, self._instances)}"
            )
        return check_pose(X_WG, "X_WG")

    def _others(self, instance: str) -> list[str]:
        """Names of all bodies but the target, the deciding ones first; see `HandClearance`."""
        return [name for name in self._order if name in self._bodies and name != instance]

    def _swept_down(self, height: float) -> dict[str, Body]:
        """All bodies, as they sweep when in place of the hand all else moves: down."""
        if height not in self._below:
            bodies = self._bodies.items()
            self._below[height] = {name: swept_body(body, -height * UP) for name, body in bodies}
        return self._below[height]

    def _lift_screens(self, instance: str, height: float) -> list[HandScreen]:
        """The parts of the hand against what the others sweep."""
        key = instance, height
        if key not in self._lifts:
            swept = self._swept_down(height)
            below = {name: swept[name] for name in self._others(instance)}
            self._lifts[key] = [HandScreen(part.shapes, below) for part in self._parts]
        return self._lifts[key]

    def _rise(self, instance: str, height: float) -> _Blocked | None:
        """What is in the way of the target itself, if anything."""
        key = instance, height
        if key not in self._rises:
            swept = self._swept_down(height)
            others = {name: (self._bodies[name], swept[name]) for name in self._others(instance)}
            self._rises[key] = _rise(self._bodies[instance], others, height)
        return self._rises[key]


def _ranks(names: NDArray[np.object_], order: Sequence[str]) -> NDArray[np.intp]:
    """Places (N,) of names in an order; its length for what is not in it."""
    place = {name: i for i, name in enumerate(order)}
    return np.array([place.get(name, len(order)) for name in names], dtype=np.intp)


@dataclass(frozen=True)
class _Blocked:
    """What is in the way of an object: its name, how deep, and after which way [m]."""

    by: str
    depth: float
    at: float


def _rise(target: Body, others: Mapping[str, tuple[Body, Body]], height: float) -> _Blocked | None:
    """The first of the bodies that a target gets deeper into on its way up than it is at rest.

    Args:
        target: where it stands.
        others: bodies where they stand, and swept down.
        height: of the lift [m].
    """
    X_WO = make_pose(target.X_WB.R, target.X_WB.p)
    places = np.linspace(0.0, height, int(np.ceil(height / STEP)) + 1)
    path = np.repeat(X_WO[None], len(places), axis=0)
    path[:, 2, 3] += places
    still = HandScreen(target.pieces, {name: body for name, (body, _) in others.items()})
    swept = HandScreen(target.pieces, {name: below for name, (_, below) in others.items()})
    for name in others:
        if swept.deepest(path[:1], [name], faces_only=True)[1][0] <= AT_REST:
            continue  # an upper bound, which is quick and settles most
        allowed = still.deepest(path[:1], [name])[1][0] + AT_REST
        if swept.deepest(path[:1], [name])[1][0] <= allowed:
            continue
        depths = still.deepest(path, [name])[1]
        if depths.max() > allowed:
            return _Blocked(name, float(depths.max()), float(places[depths.argmax()]))
    return None
