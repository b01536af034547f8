"""Robot and scene for `reach_prover`, put together with Drake's `Parser` from the documents: poses
and Jacobians of the hand, and what overlaps.

Nothing of `burg_drake.motion` or of the builder of diagrams is used.
"""

from __future__ import annotations

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

from burg_drake.core import data_root
from burg_drake.scene import Scene
from burg_drake.station import Station

Array = NDArray[np.float64]

MARGIN = 0.01
"""Distance that is kept from the joint limits [rad]."""
CONVERGED = 1e-7
"""Error of a posture [m and rad]."""
DEEPER = 1e-3
"""What the target touches at rest counts where it gets deeper by more than that [m]."""
ROUNDED = 1e-9
"""What rests on something exactly may be so deep in it once its pose has been computed [m]."""


class RobotKinematics:
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


class ProvingWorld:
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
    """The joints of a model that have one position, from base to hand."""
    joints = map(plant.get_joint, plant.GetJointIndices(model))
    return [joint for joint in joints if joint.num_positions() == 1]
