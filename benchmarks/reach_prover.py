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
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Box, QueryObject
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import (
    BodyIndex,
    JacobianWrtVariable,
    Joint,
    ModelInstanceIndex,
    RigidBody,
    SpatialInertia,
)
from pydrake.systems.framework import DiagramBuilder

from burg_drake.core.resources import data_root
from burg_drake.scene.scene import Scene
from burg_drake.station.station import Station

Array = NDArray[np.float64]

MARGIN = 0.01
"""Distance that is kept from the joint limits [rad]."""
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
CONVERGED = 1e-7
"""Error of a posture [m and rad]."""
NEWTON = 25
"""Most of Newton's steps from a random start; from a near one a third of it."""
DEEPER = 1e-3
"""What the target touches at rest counts where it gets deeper by more than that [m]."""
ROUNDED = 1e-9
"""What rests on something exactly may be so deep in it once its pose has been computed [m]."""
STRIDE, FINE = 0.5, 0.02
"""Longest edge of a random tree, and between two looks along it: of the joint that moves most
[rad]."""
TREES = 400
"""Samples of a random tree."""
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
        self._arm, self._hand = _World(scene, station, arm=True), _World(scene, station, arm=False)
        self._home = np.array(arm.home)
        self._X_GH = np.linalg.inv(station.hand.X_HG.matrix())
        self._standoff, self._lift = standoff, lift
        self._kinematics = _Kinematics(station)
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
            transfer = self._transfer(approach[-1], rng)
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

    def _transfer(self, goal: Array, rng: np.random.Generator) -> Array | None:
        """A path from home, straight or by two random trees that grow towards each other."""
        if self._straight(self._home, goal):
            return np.array([self._home, goal])
        k = self._kinematics
        trees = [_Tree(self._home), _Tree(goal)]
        for turn in range(TREES):
            here, there = trees[turn % 2], trees[1 - turn % 2]
            node = self._extend(here, rng.uniform(k.lower, k.upper))
            if node is None:
                continue
            other: int | None = -1
            while other is not None:
                other = self._extend(there, here.q[node])
                if other is not None and np.abs(there.q[other] - here.q[node]).max() < 1e-9:
                    ways = [here.branch(node), there.branch(other)]
                    first, last = ways if turn % 2 == 0 else ways[::-1]
                    return np.concatenate([first[::-1], last[1:]])
        return None

    def _extend(self, tree: _Tree, towards: Array) -> int | None:
        near = int(np.abs(np.array(tree.q) - towards).max(axis=1).argmin())
        far = np.abs(towards - tree.q[near]).max()
        new = tree.q[near] + min(1.0, STRIDE / max(far, 1e-9)) * (towards - tree.q[near])
        if not self._straight(tree.q[near], new):
            return None
        return tree.add(new, near)

    def _straight(self, q: Array, after: Array) -> bool:
        count = int(np.ceil(np.abs(after - q).max() / FINE)) + 1
        return all(self._arm.is_free(q + s * (after - q)) for s in np.linspace(1.0, 0.0, count))


@dataclass(frozen=True, eq=False)
class _Task:
    instance: str
    X_WG: Array
    width: float


class _Tree:
    def __init__(self, root: Array) -> None:
        self.q, self._before = [root], [-1]

    def add(self, q: Array, before: int) -> int:
        self.q.append(q)
        self._before.append(before)
        return len(self.q) - 1

    def branch(self, node: int) -> Array:
        """Configurations from a node to the root."""
        rows = []
        while node >= 0:
            rows.append(self.q[node])
            node = self._before[node]
        return np.array(rows)


def _chain(nodes: list[tuple[int, Array, int]], number: int) -> list[int]:
    """Numbers of a node and of those before it."""
    chain = []
    while number >= 0:
        chain.append(number)
        number = nodes[number][2]
    return chain


class _Kinematics:
    """The robot alone: poses and Jacobians of the hand, by Drake."""

    def __init__(self, station: Station) -> None:
        self._plant = MultibodyPlant(0.0)
        arm, hand = _add_robot(self._plant, _parser(self._plant), station, arm=True)
        self._plant.Finalize()
        self._context = self._plant.CreateDefaultContext()
        self._hand = hand
        joints = _moving(self._plant, arm)
        self._at = [joint.position_start() for joint in joints]
        self._rates = [joint.velocity_start() for joint in joints]
        self._q = self._plant.GetPositions(self._context)
        self.lower = np.array([joint.position_lower_limits()[0] for joint in joints]) + MARGIN
        self.upper = np.array([joint.position_upper_limits()[0] for joint in joints]) - MARGIN

    def X_WH(self, q: Array) -> Array:
        """(4, 4) hand body."""
        self._q[self._at] = q
        self._plant.SetPositions(self._context, self._q)
        return self._plant.EvalBodyPoseInWorld(self._context, self._hand).GetAsMatrix4()

    def jacobian(self) -> Array:
        """(6, n) at the posture that was asked about last."""
        world = self._plant.world_frame()
        J = self._plant.CalcJacobianSpatialVelocity(
            *(self._context, JacobianWrtVariable.kV, self._hand.body_frame(), np.zeros(3)),
            *(world, world),
        )
        return np.asarray(J[:, self._rates])

    def null(self, q: Array) -> Array | None:
        """(n,) a motion that leaves the hand where it is, its largest part 1 or more than the
        others; None if there is none."""
        self.X_WH(q)
        _, _, V = np.linalg.svd(self.jacobian())
        if len(V) <= 6:
            return None
        largest = np.abs(V[6]).argmax()
        return np.asarray(V[6] / V[6][largest])

    def solve(self, X_WH: Array, start: Array, steps: int) -> Array | None:
        """The posture that Newton's steps of least length get to within the limits."""
        q = np.clip(start, self.lower, self.upper)
        for _ in range(steps + 1):
            X = self.X_WH(q)
            R = RotationMatrix(RotationMatrix.ProjectToRotationMatrix(X_WH[:3, :3] @ X[:3, :3].T))
            turn = R.ToAngleAxis()
            error = np.append(turn.angle() * turn.axis(), X_WH[:3, 3] - X[:3, 3])
            if np.abs(error).max() < CONVERGED:
                return q
            J = self.jacobian()
            damped = J @ J.T + 1e-2 * float(error @ error) * np.eye(6) + 1e-12 * np.eye(6)
            q = np.clip(q + J.T @ np.linalg.solve(damped, error), self.lower, self.upper)
        return None


class _World:
    """Robot and scene, and what collides.

    Args:
        scene, station: what stands where.
        arm: whether the hand is on the arm; it floats otherwise.
    """

    def __init__(self, scene: Scene, station: Station, *, arm: bool) -> None:
        builder = DiagramBuilder()
        self._plant, self._graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        plant, parser = self._plant, _parser(self._plant)
        table = station.document.table
        center = (*table.center, -0.5 * table.size[2])
        self._add_box("table", RigidTransform(center), np.array(table.size))
        for name, box in station.document.background.items():
            self._add_box(name, RigidTransform(box.X_WB.matrix()), np.array(box.size))
        self._objects: dict[str, RigidBody] = {}
        self._placed: dict[str, RigidTransform] = {}
        for name in (*scene.instances, *scene.background):
            assert scene.entry(name).contact.kind != "mesh", "its hull would stand in for it"
            (model,) = parser.AddModels(str(scene.library.path(scene.entry(name).sdf)))
            (index,) = plant.GetBodyIndices(model)
            self._objects[name] = plant.get_body(index)
            X_WO = station.document.X_WS.matrix() @ scene.X_SO(name)
            self._placed[name] = RigidTransform(X_WO)
        robot, self._hand = _add_robot(plant, parser, station, arm=arm)
        plant.Finalize()
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()
        self._state = plant.GetMyMutableContextFromRoot(self._context)
        for name, X_WO in self._placed.items():
            plant.SetFreeBodyPose(self._state, self._objects[name], X_WO)
        self._joints = [joint.position_start() for joint in _moving(plant, robot)] if arm else []
        self._fingers, self._opening = station.hand.fingers, station.hand.opening
        in_hand = plant.GetBodyIndices(self._hand.model_instance())
        still = {body.index() for body in plant.GetBodiesWeldedTo(plant.world_body())}
        self._in_hand: set[BodyIndex] = set(in_hand)
        self._movers = (
            self._in_hand | (set(plant.GetBodyIndices(robot)) if arm else set())
        ) - still
        self._X_HO = RigidTransform()
        self._set_fingers(np.nan)
        self._at_rest = self._overlaps()

    def _add_box(self, name: str, X_WB: RigidTransform, size: Array) -> None:
        plant = self._plant
        inertia = SpatialInertia.SolidBoxWithMass(1.0, *size)
        body = plant.AddRigidBody(name, plant.AddModelInstance(name), inertia)
        plant.RegisterCollisionGeometry(
            body, RigidTransform(), Box(*size), name, CoulombFriction(0.5, 0.5)
        )
        plant.WeldFrames(plant.world_frame(), body.body_frame(), X_WB)

    def place_hand(self, X_WH: Array) -> None:
        """Puts the floating hand somewhere."""
        self._plant.SetFreeBodyPose(self._state, self._hand, RigidTransform(X_WH))

    def grip(self, instance: str, X_WH: Array) -> None:
        """Ties an object to the hand where the two are when it is gripped."""
        self._X_HO = RigidTransform(X_WH).inverse() @ self._placed[instance]

    def is_free(self, q: Array, held: str = "", width: float = np.nan) -> bool:
        """Whether nothing overlaps at arm positions (n,); what is gripped may be in the hand, with
        this distance between the pads [m]."""
        positions = self._plant.GetPositions(self._state)
        positions[self._joints] = q
        self._plant.SetPositions(self._state, positions)
        return self.free_as_set(held, width)

    def free_as_set(self, held: str, width: float) -> bool:
        """Whether nothing overlaps with the robot as it is; see `is_free`."""
        self._set_fingers(width)
        if held:
            X_WH = self._plant.EvalBodyPoseInWorld(self._state, self._hand)
            self._plant.SetFreeBodyPose(self._state, self._objects[held], X_WH @ self._X_HO)
        body = self._objects[held].index() if held else None
        free = not any(self._counts(pair, depth, body) for pair, depth in self._overlaps().items())
        if held:
            self._plant.SetFreeBodyPose(self._state, self._objects[held], self._placed[held])
        return free

    def _counts(self, pair: frozenset[BodyIndex], depth: float, held: BodyIndex | None) -> bool:
        if held in pair:
            touching = self._at_rest.get(pair)
            allowed = ROUNDED if touching is None else touching + DEEPER
            return not pair & self._in_hand and depth > allowed
        return bool(pair & self._movers)

    def _set_fingers(self, width: float) -> None:
        low, high = self._opening
        closed = 0.0 if np.isnan(width) else (high - width) / (high - low)
        for finger in self._fingers:
            joint = self._plant.GetJointByName(finger.joint, self._hand.model_instance())
            joint.set_translation(self._state, finger.open + closed * (finger.closed - finger.open))

    def _overlaps(self) -> dict[frozenset[BodyIndex], float]:
        graph = self._graph.GetMyContextFromRoot(self._context)
        query: QueryObject = self._graph.get_query_output_port().Eval(graph)
        inspector, depths = query.inspector(), {}
        for overlap in query.ComputePointPairPenetration():
            frames = [inspector.GetFrameId(g) for g in (overlap.id_A, overlap.id_B)]
            pair = frozenset(self._plant.GetBodyFromFrameId(frame).index() for frame in frames)
            depths[pair] = max(depths.get(pair, 0.0), overlap.depth)
        return depths


def _parser(plant: MultibodyPlant) -> Parser:
    parser = Parser(plant)
    parser.package_map().Remove("drake_models")
    parser.package_map().Add("burg_drake", str(data_root()))
    parser.SetAutoRenaming(True)
    return parser


def _add_robot(
    plant: MultibodyPlant, parser: Parser, station: Station, *, arm: bool
) -> tuple[ModelInstanceIndex, RigidBody]:
    """Adds the hand, and the arm that carries it; returns the model that moves, and the body H."""
    (hand,) = parser.AddModels(str(station.hand_model))
    body = plant.GetBodyByName(station.hand.body, hand)
    document = station.document.arm
    if not arm or document is None:
        return hand, body
    (model,) = parser.AddModels(str(station.arm_model))
    X_WA, X_FH = (RigidTransform(X.matrix()) for X in (document.X_WA, document.X_FH))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(document.base, model), X_WA)
    plant.WeldFrames(plant.GetFrameByName(document.flange, model), body.body_frame(), X_FH)
    return model, body


def _moving(plant: MultibodyPlant, model: ModelInstanceIndex) -> list[Joint]:
    return list(_joints(plant, model))


def _joints(plant: MultibodyPlant, model: ModelInstanceIndex) -> Iterator[Joint]:
    for index in plant.GetJointIndices(model):
        joint = plant.get_joint(index)
        if joint.num_positions() == 1:
            yield joint
