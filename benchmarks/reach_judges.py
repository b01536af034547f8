"""Other judges of reach: an exhaustive one and a plain one.

`Exhaustive` sweeps the redundant joint finely at every 2.5 cm of the hand's way, looks through all
postures there and joins those of neighbouring poses, without a look between them: it may say yes
where a motion in between collides. `Plain` is what Drake's tutorials suggest: `InverseKinematics`
with SNOPT, restarted at random, and a rapidly-exploring random tree. Both plan from home with
RRT-Connect (Kuffner and LaValle, "RRT-Connect: an efficient approach to single-query path
planning", ICRA 2000).

Their searches are their own, and so are the verdicts of Drake's checker that they ask about each
configuration. What they share with `ArmReach` is how those questions are put (`ArmCollision`: what
is filtered, what is carried), and `Exhaustive` has its postures from `PandaIk`. Like `ArmCollision`
neither holds the target against the scene on the lift; `reach_audit` does, and shares nothing.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.inverse_kinematics import InverseKinematics
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.solvers import SnoptSolver

from burg_drake.core import Array, inverse, rng_from, swap_fingers
from burg_drake.motion import ArmCollision, ArmKinematics, PandaIk
from burg_drake.scene import Scene
from burg_drake.station import Station, build_station_diagram

LAYER = 0.025
"""Distance between the hand poses of the exhaustive judge [m]."""
VALUES = 120
"""Values of the redundant joint at each of them."""
JOIN = 0.5
"""Postures of neighbouring poses whose joints differ by no more than this are joined [rad]."""
STARTS = 6
"""Pregrasp postures that a path is planned to."""
RESTARTS = 10
"""Of the plain judge, for each way to put the fingers."""
ROW = 0.01
"""Step of the plain judge along the hand's way [m]: that of the rows of our motions."""
MARGIN = 0.01
"""Distance from the joint limits [rad]."""
STRIDE = 0.4
"""Longest extension of a random tree [rad]."""
RESOLUTION = 0.04
"""Distance between checks along an extension: of the joint that moves most [rad]."""


class World:
    """Arm and scene, with collision checks by Drake alone."""

    def __init__(self, scene: Scene, station: Station, standoff: float, lift: float) -> None:
        arm = station.document.arm
        assert arm is not None
        diagram = build_station_diagram(scene, station, robot="arm", weld_objects=True)
        self.collision = ArmCollision(diagram)
        self.kinematics = ArmKinematics.of(diagram)
        self.station, self.home = station, np.array(arm.home)
        self.standoff, self.lift = standoff, lift
        self.lower = self.kinematics.lower + MARGIN
        self.upper = self.kinematics.upper - MARGIN
        self._X_AW = inverse(arm.X_WA.matrix())
        self._up_A = arm.X_WA.matrix()[2, :3]
        self._X_GH = inverse(station.hand.X_HG.matrix())

    def X_AH(self, X_WG: Array, way: float) -> Array:
        """(4, 4) hand body at a length from the grasp: before it if negative, else above."""
        X = self._X_AW @ X_WG
        X[:3, 3] += min(way, 0.0) * X[:3, 2] + max(way, 0.0) * self._up_A
        return X @ self._X_GH

    def is_free(self, q: Array, instance: str = "", way: float = 0.0) -> bool:
        """Whether the arm is free there, with the target in the hand above the grasp."""
        carried = instance if way > 0.0 else None
        return self.collision.is_free(q, carried=carried, moved_W=(0.0, 0.0, max(0.0, way)))

    def is_free_straight(self, q: Array, q_after: Array) -> bool:
        """Whether a straight motion without target is free."""
        count = int(np.ceil(np.abs(q_after - q).max() / RESOLUTION)) + 1
        return all(self.is_free(q + s * (q_after - q)) for s in np.linspace(1.0, 0.0, count))

    def connects(self, goal: Array, budget: int) -> bool:
        """Whether a path from home to a goal is found, straight or by RRT-Connect."""
        if self.is_free_straight(self.home, goal):
            return True
        rng = rng_from("reach judge", goal)
        trees = [[self.home], [goal]]
        for turn in range(budget):
            here, there = trees[turn % 2], trees[1 - turn % 2]
            new = self._extend(here, rng.uniform(self.lower, self.upper))
            if new is not None and self._meets(there, new):
                return True
        return False

    def _extend(self, tree: list[Array], towards: Array) -> Array | None:
        near = min(tree, key=lambda q: float(np.abs(q - towards).max()))
        far = np.abs(towards - near).max()
        q = near + min(1.0, STRIDE / max(far, 1e-9)) * (towards - near)
        if not self.is_free_straight(near, q):
            return None
        tree.append(q)
        return q

    def _meets(self, tree: list[Array], goal: Array) -> bool:
        while (new := self._extend(tree, goal)) is not None:
            if np.abs(new - goal).max() < 1e-9:
                return True
        return False


class PlainWorld(World):
    """The same with Drake's checker as it comes, without the scene tied to the world."""

    def is_free(self, q: Array, instance: str = "", way: float = 0.0) -> bool:
        """See `World`."""
        if way > 0.0:
            return super().is_free(q, instance, way)
        collision = self.collision
        return bool(collision.checker.CheckConfigCollisionFree(collision.configuration(q)))


class Exhaustive:
    """Looks through all postures of a Panda along the hand's way; see the module."""

    def __init__(self, world: World, *, budget: int = 400) -> None:
        ik = PandaIk.of(world.kinematics)
        assert ik is not None, "the exhaustive judge knows the Panda alone"
        self._world, self._budget = world, budget
        self._ik = ik.within(MARGIN)
        self._values = np.linspace(world.lower[6], world.upper[6], VALUES)
        before = np.arange(0.0, world.standoff + 1e-9, LAYER)[:0:-1]
        self._ways = np.concatenate([-before, np.arange(0.0, world.lift + 1e-9, LAYER)])

    def check(self, instance: str, X_WG: Array) -> bool:
        """Whether there is a motion."""
        tried = 0
        for X in (X_WG, swap_fingers(X_WG)):
            for start in self._starts(instance, X):
                if self._world.connects(start, self._budget):
                    return True
                tried += 1
                if tried >= STARTS:
                    return False
        return False

    def _starts(self, instance: str, X_WG: Array) -> Iterator[Array]:
        """Pregrasp postures that a chain to the top of the lift begins with, near home first."""
        poses = np.array([self._world.X_AH(X_WG, way) for way in self._ways])
        found = self._ik.solve(poses, self._values)
        layers = [found.q[found.pose == k] for k in range(len(poses))]
        if not all(map(len, layers)):
            return
        free: list[dict[int, bool]] = [{} for _ in layers]
        dead: list[set[int]] = [set() for _ in layers]

        def is_free(layer: int, k: int) -> bool:
            if k not in free[layer]:
                q = layers[layer][k]
                free[layer][k] = self._world.is_free(q, instance, self._ways[layer])
            return free[layer][k]

        def leads_up(layer: int, k: int) -> bool:
            stack = [(layer, k)]
            seen = {(layer, k)}
            while stack:
                at, i = stack.pop()
                if not is_free(at, i):
                    continue
                if at == len(layers) - 1:
                    return True
                travel = np.abs(layers[at + 1] - layers[at][i]).max(axis=1)
                near = np.flatnonzero(travel <= JOIN)
                for j in near[np.argsort(-travel[near])].tolist():
                    if (at + 1, j) not in seen and j not in dead[at + 1]:
                        seen.add((at + 1, j))
                        stack.append((at + 1, j))
            for at, i in seen:
                dead[at].add(i)
            return False

        order = np.argsort(np.abs(layers[0] - self._world.home).max(axis=1))
        for k in order.tolist():
            if k not in dead[0] and leads_up(0, k):
                yield layers[0][k]
                near = np.abs(layers[0] - layers[0][k]).max(axis=1) < JOIN
                dead[0].update(np.flatnonzero(near).tolist())


class Plain:
    """SNOPT, restarted at random, and RRT-Connect; see the module."""

    def __init__(self, world: World, *, budget: int = 150) -> None:
        self._world, self._budget = world, budget
        self._plant = MultibodyPlant(0.0)
        self._hand = self._add_robot(world.station)
        self._plant.Finalize()

    def _add_robot(self, station: Station) -> RigidBody:
        plant, arm = self._plant, station.document.arm
        assert arm is not None
        parser = Parser(plant)
        (model,) = parser.AddModels(str(station.arm_model))
        (hand,) = parser.AddModels(str(station.hand_model))
        base, flange = (plant.GetFrameByName(name, model) for name in (arm.base, arm.flange))
        body = plant.GetBodyByName(station.hand.body, hand)
        plant.WeldFrames(plant.world_frame(), base, RigidTransform())
        plant.WeldFrames(flange, body.body_frame(), RigidTransform(arm.X_FH.matrix()))
        return body

    def check(self, instance: str, X_WG: Array) -> bool:
        """Whether a motion is found."""
        world = self._world
        rng = rng_from("plain judge", X_WG)
        for X in (X_WG, swap_fingers(X_WG)):
            for _ in range(RESTARTS):
                q = self._solve(world.X_AH(X, 0.0), rng.uniform(world.lower, world.upper))
                if q is None or not world.is_free(q, instance, 0.0):
                    continue
                start = self._follow(instance, X, q, -rows(world.standoff))
                if start is None or self._follow(instance, X, q, rows(world.lift)) is None:
                    continue
                if world.connects(start, self._budget):
                    return True
        return False

    def _follow(self, instance: str, X_WG: Array, q: Array, ways: Array) -> Array | None:
        """Arm positions at the last of some lengths, each found from the one before."""
        for way in ways:
            after = self._solve(self._world.X_AH(X_WG, way), q)
            if after is None or np.abs(after - q).max() > 2.0 * JOIN:
                return None
            if not self._world.is_free(after, instance, way):
                return None
            q = after
        return q

    def _solve(self, X_AH: Array, start: Array) -> Array | None:
        problem = InverseKinematics(self._plant)
        base, hand = self._plant.world_frame(), self._hand.body_frame()
        problem.AddPositionConstraint(
            hand, np.zeros(3), base, X_AH[:3, 3] - 1e-5, X_AH[:3, 3] + 1e-5
        )
        R_AH = RotationMatrix(X_AH[:3, :3])
        problem.AddOrientationConstraint(base, R_AH, hand, RotationMatrix(), 1e-4)
        others = self._plant.num_positions() - len(start)
        problem.prog().SetInitialGuess(problem.q(), np.append(start, np.full(others, 0.03)))
        result = SnoptSolver().Solve(problem.prog())
        if not result.is_success():
            return None
        q = np.asarray(result.GetSolution(problem.q())[: len(start)])
        inside = (q >= self._world.lower).all() and (q <= self._world.upper).all()
        return q if inside else None


def rows(length: float) -> Array:
    """Distances from the grasp along a way, without the grasp itself [m]."""
    return np.linspace(0.0, length, int(np.ceil(length / ROW - 1e-9)) + 1)[1:]
