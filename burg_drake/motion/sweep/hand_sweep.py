"""The hand on its straight segments to a grasp, back from it and along the lift, for many grasps,
without the arm.

A way is judged as a whole, not at samples: what a convex part sweeps along a straight segment is
convex (`geometry.swept`), so that one overlap and one distance tell whether the way is free, and
how far from everything it stays.

Nothing here depends on what else is in a batch, not in its last bit: see `geometry.convex`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, UnknownNameError, check_pose, nearest
from burg_drake.geometry import Body, HandScreen, Shape, swept_body, swept_shape
from burg_drake.motion.sweep.deepest_overlap import deepest_along_path
from burg_drake.motion.sweep.hand_parts import is_symmetric, read_hand
from burg_drake.motion.sweep.target_sweep import PathBlockers, TargetSweep
from burg_drake.scene.document import Scene
from burg_drake.station.diagram import build_station_diagram
from burg_drake.station.document import GraspMotion, Station

BACK_G = np.array((0.0, 0.0, -1.0))
"""Of the retreat, and of the way from grasp to pregrasp, in the grasp frame."""


@dataclass(frozen=True, eq=False)
class Sweep:
    """What is in the way of N hands.

    Attributes:
        free: (N,) whether nothing is.
        blocker: (N,) name of the body that is; "" where the way is free.
        clearance: (N,) smallest signed distance on the way [m]. Where it is free, that of the hand
            from other bodies: a lower bound, exact where no cylinder is swept across its axis (see
            `geometry.swept.SIDES`). Where not, minus the depth of the overlap with the blocker.
        at: (N,) how far from the grasp that depth is met [m]; NaN where the way is free, or the
            overlap too short to be found.
    """

    free: NDArray[np.bool_]
    blocker: NDArray[np.object_]
    clearance: Array
    at: Array

    def __len__(self) -> int:
        return len(self.free)

    def put(self, rows: NDArray[np.intp], target: PathBlockers) -> None:
        """Takes over what is in the way of the target on some ways (S,), where anything is."""
        hit = np.flatnonzero(target.by != "")
        rows = rows[hit]
        self.free[rows], self.blocker[rows] = False, target.by[hit]
        self.clearance[rows], self.at[rows] = -target.depth[hit], target.at[hit]


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
        self._motion = motion
        diagram = build_station_diagram(scene, station, robot="hand")
        self._instances = tuple(diagram.free)
        self._order = ("table", *sorted(diagram.fixed), *sorted(diagram.free))
        self._parts, self._bodies = read_hand(diagram)
        self.symmetric = is_symmetric(self._parts)
        shapes = [shape for part in self._parts for shape in part.shapes]
        self._open = HandScreen(shapes, self._bodies)
        self._approach = HandScreen(_swept(shapes, motion.standoff), self._bodies)
        self._still = [HandScreen(part.shapes, self._bodies) for part in self._parts]
        self._retreat = [
            HandScreen(_swept(part.shapes, motion.retreat), self._bodies) for part in self._parts
        ]
        self._against: dict[float, dict[str, Body]] = {}
        self._lifts: dict[tuple[str, float], list[HandScreen]] = {}
        self._targets: dict[str, TargetSweep] = {}
        self._risen: dict[tuple[str, float], PathBlockers] = {}

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
        depth, at[hit] = deepest_along_path(
            self._open, X_WG[hit], names[hit], back_W, self._motion.standoff
        )
        clearance[hit] = -depth
        return Sweep(names == "", names, clearance, at)

    def retreat(self, instance: str, X_WG: Array, width: Array) -> Sweep:
        """The hand with the target in it on its way straight back along the approach.

        Hand and fingers count against all but the target, and the target against all others: where
        the hand is free and the target is not, what is in the target's way is the blocker.

        Args:
            instance: the target's name in the scene; "" if the hand is empty.
            X_WG: (N, 4, 4) grasps in the world.
            width: (N,) distance between the pads once they hold the target [m]; the hand is open
                where it is NaN.

        Raises:
            UnknownNameError: there is no such instance.
            InvalidInputError: `X_WG` are not poses.
        """
        X_WG, length = self._checked(instance, X_WG), self._motion.retreat
        back_W = -X_WG[:, :3, 2]
        found = self._closed(instance, self._retreat, X_WG, width, back_W, length)
        if instance:
            free = np.flatnonzero(found.free)
            found.put(free, self._target(instance).retreat(back_W[free], length))
        return found

    def lift(self, instance: str, X_WG: Array, width: Array, height: float | None = None) -> Sweep:
        """The hand with the target in it on its lift, which begins where the retreat ends.

        Args:
            instance, X_WG, width: see `retreat`.
            height: how far it goes [m]; by the whole lift if None.

        Raises:
            UnknownNameError: there is no such instance.
            InvalidInputError: `X_WG` are not poses.
        """
        X_WG, motion = self._checked(instance, X_WG), self._motion
        height = motion.lift_height if height is None else height
        start_W = -motion.retreat * X_WG[:, :3, 2]
        X_WR = X_WG.copy()
        X_WR[:, :3, 3] += start_W
        along_W = np.broadcast_to(motion.direction_W, (len(X_WG), 3))
        screens = self._lift_screens(instance, height)
        found = self._closed(instance, screens, X_WR, width, along_W, height)
        if instance:
            free = np.flatnonzero(found.free)
            found.put(free, self._lifted(instance, start_W[free], height))
        return found

    def _closed(
        self,
        instance: str,
        screens: Sequence[HandScreen],
        X_WG: Array,
        width: Array,
        u_W: Array,
        length: float,
    ) -> Sweep:
        """The hand around the target on straight segments from N poses (N, 4, 4).

        Args:
            instance: the target, which does not count.
            screens: for each part of the hand what it sweeps, or the others against it.
            X_WG: where the ways begin.
            width: (N,) distance between the pads [m].
            u_W: (N, 3) unit vectors along the ways.
            length: of the ways [m].
        """
        others = self._others(instance)
        placed = [part.placed(X_WG, np.asarray(width, float)) for part in self._parts]
        moves = list(zip(screens, placed, strict=True))
        ranks = np.array([_ranks(screen.deepest(X, others)[0], others) for screen, X in moves])
        names = np.array([*others, ""], dtype=object)[ranks.min(axis=0)]
        decisive = ranks.argmin(axis=0)
        clearance, at = np.full(len(X_WG), np.inf), np.full(len(X_WG), np.nan)
        free = np.flatnonzero(names == "")
        for k, (screen, X) in enumerate(moves):
            clearance[free] = np.minimum(clearance[free], screen.nearest(X[free])[1])
            hit = np.flatnonzero((names != "") & (decisive == k))
            depth, at[hit] = deepest_along_path(
                self._still[k], X[hit], names[hit], u_W[hit], length
            )
            clearance[hit] = -depth
        return Sweep(names == "", names, clearance, at)

    def _checked(self, instance: str, X_WG: Array) -> Array:
        if instance and instance not in self._instances:
            raise UnknownNameError(
                f"instance {instance!r} does not exist; {nearest(instance, self._instances)}"
            )
        return check_pose(X_WG, "X_WG")

    def _others(self, instance: str) -> list[str]:
        """Names of all bodies but the target, the deciding ones first; see `HandClearance`."""
        return [name for name in self._order if name in self._bodies and name != instance]

    def _moved_against(self, height: float) -> dict[str, Body]:
        """All bodies, as they sweep when in place of the hand all else moves: against the lift."""
        if height not in self._against:
            shift_W = -height * self._motion.direction_W
            bodies = self._bodies.items()
            self._against[height] = {name: swept_body(body, shift_W) for name, body in bodies}
        return self._against[height]

    def _lift_screens(self, instance: str, height: float) -> list[HandScreen]:
        """The parts of the hand against what the others sweep."""
        key = instance, height
        if key not in self._lifts:
            swept = self._moved_against(height)
            others = {name: swept[name] for name in self._others(instance)}
            self._lifts[key] = [HandScreen(part.shapes, others) for part in self._parts]
        return self._lifts[key]

    def _target(self, instance: str) -> TargetSweep:
        if instance not in self._targets:
            others = {name: self._bodies[name] for name in self._others(instance)}
            self._targets[instance] = TargetSweep(self._bodies[instance], others)
        return self._targets[instance]

    def _lifted(self, instance: str, start_W: Array, height: float) -> PathBlockers:
        """What is in the way of the target on the lift; without a retreat that is the same for all
        grasps."""
        shift_W, u_W = self._target(instance), self._motion.direction_W
        swept = self._moved_against(height)
        if self._motion.retreat > 0.0:
            return shift_W.lift(start_W, u_W, height, swept)
        key = instance, height
        if key not in self._risen:
            self._risen[key] = shift_W.lift(np.zeros((1, 3)), u_W, height, swept)
        return self._risen[key].repeated(len(start_W))


def _swept(shapes: Sequence[Shape], length: float) -> list[Shape]:
    """What shapes in the grasp frame sweep on a way straight back [m]."""
    return [swept for shape in shapes for swept in swept_shape(shape, length * BACK_G)]


def _ranks(names: NDArray[np.object_], order: Sequence[str]) -> NDArray[np.intp]:
    """Places (N,) of names in an order; its length for what is not in it."""
    place = {name: i for i, name in enumerate(order)}
    return np.array([place.get(name, len(order)) for name in names], dtype=np.intp)
