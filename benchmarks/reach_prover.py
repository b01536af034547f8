"""A judge of reach that shares nothing with `burg_drake.motion`: what it says yes to is proven.

It has plants of its own, put together with Drake's `Parser`, takes steps of Newton on Drake's
Jacobians, looks for collisions with `SceneGraph`, and plans from home with RRT-Connect (Kuffner and
LaValle, ICRA 2000). From many postures at the grasp it searches both straight ways in depth, 2 cm
at a time, with steps along the null space of the Jacobian. A motion that it finds is gone through
once more, every 2 mm of the hand's way; what passes is a proof that the grasp can be reached. What
it does not find may still exist.

From `burg_drake` it has the documents of scene and station and nothing else.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np
from proving_tree import RandomTrees
from proving_world import Array, ProvingWorld, RobotKinematics

from burg_drake.scene import Scene
from burg_drake.station import Station

STEP = 0.02
"""From pose to pose of the search along the hand's way [m]."""
DENSE = 0.002
"""The same when a motion is proven [m]."""
TRAVEL = 0.8 / 0.05
"""Most that a joint may move for each metre of the hand's way [rad/m]."""
STRAY = 1e-4
"""Farthest of the hand from its straight way, half-way between two rows of a proof [m]."""
ROOTS = 80
"""Postures at the grasp that Newton's steps start from, for each way to put the fingers."""
SLIDES = (0.0, 0.05, -0.05, 0.2, -0.2)
"""Steps along the null space that each posture is tried with [rad]."""
CELL = 0.08
"""Postures at one pose whose joints differ by no more than this are searched once [rad]."""
EXTENSIONS = 2500
"""Steps of the search for each way to put the fingers before it is given up."""
NEWTON = 25
"""Most of Newton's steps from a random start; from a near one a third of it."""
STARTS = 4
"""Pregrasp postures that a path from home is looked for."""


@dataclass(frozen=True, eq=False)
class Proof:
    """A motion, straight in joint space between rows (M, n).

    Attributes:
        X_WG: (4, 4) the grasp, with its fingers as they are put.
        transfer: from home to the pregrasp.
        approach: from there to the grasp.
        lift: from there up.
    """

    X_WG: Array
    transfer: Array
    approach: Array
    lift: Array


class Prover:
    """Judges grasps of one scene.

    Args:
        scene, station: what stands where.
        standoff, lift: lengths of the two straight ways [m].
    """

    def __init__(self, scene: Scene, station: Station, standoff: float, lift: float) -> None:
        arm = station.document.arm
        assert arm is not None
        self._arm = ProvingWorld(scene, station, arm=True)
        self._hand = ProvingWorld(scene, station, arm=False)
        self._home = np.array(arm.home)
        self._X_GH = np.linalg.inv(station.hand.X_HG.matrix())
        self._standoff, self._lift = standoff, lift
        self._kinematics = RobotKinematics(station)
        self._trees = RandomTrees(self._arm, self._kinematics)
        assert self._arm.is_free(self._home)

    def prove(self, instance: str, X_WG: Array, width: float) -> Proof | None:
        """A motion to a grasp, if one is found.

        Args:
            instance: name of the target.
            X_WG: (4, 4) the grasp in the world.
            width: distance between the pads that hold the target [m].
        """
        rng = np.random.default_rng(zlib.crc32(np.round(X_WG, 9).tobytes()))
        for X in (X_WG, X_WG @ np.diag([-1.0, -1.0, 1.0, 1.0])):
            if not self._hand_is_free(instance, X, width):
                continue
            proof = self._proof(_Task(instance, X, width), rng)
            if proof is not None:
                return proof
        return None

    def _X_WH(self, X_WG: Array, way: float) -> Array:
        """(4, 4) hand body at a length from the grasp: before it if negative, else above."""
        X = X_WG.copy()
        X[:3, 3] += min(way, 0.0) * X[:3, 2] + max(way, 0.0) * np.array([0.0, 0.0, 1.0])
        return np.asarray(X @ self._X_GH)

    def _ways(self, length: float, step: float) -> Array:
        return np.linspace(0.0, length, round(np.ceil(length / step - 1e-9)) + 1)

    def _hand_is_free(self, instance: str, X_WG: Array, width: float) -> bool:
        for way in -self._ways(self._standoff, DENSE):
            self._hand.place_hand(self._X_WH(X_WG, way))
            if not self._hand.free_as_set("", np.nan):
                return False
        self._hand.grip(instance, self._X_WH(X_WG, 0.0))
        for way in self._ways(self._lift, DENSE):
            self._hand.place_hand(self._X_WH(X_WG, way))
            if not self._hand.free_as_set(instance, width):
                return False
        return True

    def _proof(self, task: _Task, rng: np.random.Generator) -> Proof | None:
        roots = self._roots(task, rng)
        budget = [EXTENSIONS]
        dead: dict[float, list[Array]] = {}
        starts = 0
        for q in roots:
            ways = -self._ways(self._standoff, STEP)
            approach = self._line(task, q, ways, dead, budget, held=False)
            if approach is None:
                continue
            lift = self._line(task, q, self._ways(self._lift, STEP), dead, budget, held=True)
            if lift is None:
                continue
            transfer = self._trees.connect(self._home, approach[-1], rng)
            if transfer is not None:
                return Proof(task.X_WG, transfer, approach[::-1], lift)
            starts += 1
            if starts == STARTS:
                return None
        return None

    def _roots(self, task: _Task, rng: np.random.Generator) -> list[Array]:
        """Free postures at the grasp, those near home first."""
        k, found = self._kinematics, np.empty((0, len(self._home)))
        X_WH = self._X_WH(task.X_WG, 0.0)
        self._arm.grip(task.instance, X_WH)
        for start in (self._home, *rng.uniform(k.lower, k.upper, (ROOTS, len(self._home)))):
            q = k.solve(X_WH, start, NEWTON)
            if q is None or (len(found) and np.abs(found - q).max(axis=1).min() < CELL):
                continue
            if self._arm.is_free(q) and self._arm.is_free(q, task.instance, task.width):
                found = np.concatenate([found, q[None]])
        return list(found[np.argsort(np.abs(found - self._home).max(axis=1))])

    def _line(
        self,
        task: _Task,
        q: Array,
        ways: Array,
        dead: dict[float, list[Array]],
        budget: list[int],
        *,
        held: bool,
    ) -> Array | None:
        """Rows along one straight way, every `DENSE` of it, searched in depth.

        Args:
            task: the grasp.
            q: (n,) posture at its first pose.
            ways: lengths from the grasp.
            dead: postures by the length that nothing leads on from; added to.
            budget: steps that are left; counted down.
            held: whether the target is in the hand.
        """
        if len(ways) == 1:
            return q[None]
        seen: dict[float, list[Array]] = {}
        nodes: list[tuple[int, Array, int]] = [(0, q, -1)]
        refuted: set[int] = set()
        stack = [0]
        while stack and budget[0] > 0:
            number = stack.pop()
            layer, here, _ = nodes[number]
            chain = _chain(nodes, number)
            if refuted & set(chain):
                continue
            if layer == len(ways) - 1:
                corners = np.array([nodes[k][1] for k in chain[::-1]])
                rows, wrong = self._dense(task, corners, ways, held=held)
                if rows is not None:
                    return rows
                refuted.add(chain[::-1][wrong])
                continue
            after = []
            for slide in SLIDES:
                budget[0] -= 1
                new = self._step(task, here, ways[layer], ways[layer + 1], slide, held=held)
                known = [*seen.get(ways[layer + 1], []), *dead.get(ways[layer + 1], [])]
                if new is None or (known and np.abs(known - new).max(axis=1).min() < CELL):
                    continue
                seen.setdefault(ways[layer + 1], []).append(new)
                nodes.append((layer + 1, new, number))
                after.append(len(nodes) - 1)
            stack += after[::-1]
        if budget[0] > 0 and not refuted:
            for way, postures in seen.items():
                dead.setdefault(way, []).extend(postures)
        return None

    def _step(
        self, task: _Task, q: Array, way: float, after: float, slide: float, *, held: bool
    ) -> Array | None:
        """The posture at the next pose, if there is one that is free, with the one half-way."""
        start = q
        if slide:
            null = self._kinematics.null(q)
            if null is None:
                return None
            start = q + slide * null
        new = self._kinematics.solve(self._X_WH(task.X_WG, after), start, NEWTON // 3)
        if new is None or np.abs(new - q).max() > TRAVEL * abs(after - way):
            return None
        middle = self._X_WH(task.X_WG, 0.5 * (way + after))
        between = self._kinematics.solve(middle, 0.5 * (q + new), NEWTON // 3)
        if between is None:
            return None
        carried = (task.instance, task.width) if held else ("", np.nan)
        free = self._arm.is_free(new, *carried) and self._arm.is_free(between, *carried)
        return new if free else None

    def _dense(
        self, task: _Task, corners: Array, ways: Array, *, held: bool
    ) -> tuple[Array | None, int]:
        """Rows every `DENSE` through corners, or the corner that they do not get to."""
        carried = (task.instance, task.width) if held else ("", np.nan)
        rows = [corners[0]]
        for corner in range(1, len(corners)):
            before, after = ways[corner - 1], ways[corner]
            count = round(np.ceil(abs(after - before) / DENSE - 1e-9))
            for share in np.arange(1, count + 1) / count:
                X_WH = self._X_WH(task.X_WG, before + share * (after - before))
                start = corners[corner - 1] + share * (corners[corner] - corners[corner - 1])
                q = self._kinematics.solve(X_WH, start, NEWTON // 3)
                travel = TRAVEL * abs(after - before) / count
                if q is None or np.abs(q - rows[-1]).max() > max(travel, 1e-9):
                    return None, corner
                half_way = 0.5 * (rows[-1] + q)
                p_WH = self._kinematics.X_WH(half_way)[:3, 3]
                middle = before + (share - 0.5 / count) * (after - before)
                if np.linalg.norm(p_WH - self._X_WH(task.X_WG, middle)[:3, 3]) > STRAY:
                    return None, corner
                if not (self._arm.is_free(q, *carried) and self._arm.is_free(half_way, *carried)):
                    return None, corner
                rows.append(q)
        return np.array(rows), 0


@dataclass(frozen=True, eq=False)
class _Task:
    instance: str
    X_WG: Array
    width: float


def _chain(nodes: list[tuple[int, Array, int]], number: int) -> list[int]:
    """Numbers of a node and of those before it."""
    chain = []
    while number >= 0:
        chain.append(number)
        number = nodes[number][2]
    return chain
