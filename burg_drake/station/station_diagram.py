"""A built Drake diagram of a scene on a station, and handles on its hand and arm."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, Joint
from pydrake.planning import RobotDiagram
from pydrake.systems.framework import Context

from burg_drake.core import Array, InvalidInputError, inverse
from burg_drake.scene import Scene
from burg_drake.station.contact_parts import ContactParts
from burg_drake.station.engine import Engine
from burg_drake.station.hand_model import find_hand
from burg_drake.station.robot import Robot, joint_actuators
from burg_drake.station.station_document import Station

if TYPE_CHECKING:
    from pydrake.geometry import SceneGraph


@dataclass(frozen=True, eq=False)
class StationDiagram:
    """A built diagram, with its bodies by name.

    Attributes:
        diagram: the Drake diagram; keep it alive while its plant is used.
        scene, station, robot, engine: arguments of `build_station_diagram`.
        free: body of each instance that is not background, by name.
        standing: bodies of instances that could be free, but are welded at their poses, by name.
        fixed: bodies of background instances and obstacles, by name.
        parts: geometries of objects that only some bodies collide with.
        table: the table's body.
        robot_bodies: all bodies of hand and arm.
    """

    diagram: RobotDiagram
    scene: Scene
    station: Station
    robot: Robot
    engine: Engine
    free: dict[str, BodyIndex]
    standing: dict[str, BodyIndex]
    fixed: dict[str, BodyIndex]
    parts: ContactParts
    table: BodyIndex
    robot_bodies: tuple[BodyIndex, ...]
    _X_WO: dict[str, Array] = field(default_factory=dict, init=False, repr=False)

    @property
    def plant(self) -> MultibodyPlant:
        """The plant, finalized."""
        return self.diagram.plant()

    @property
    def scene_graph(self) -> SceneGraph:
        """The scene graph."""
        return self.diagram.scene_graph()

    @property
    def arm_joints(self) -> tuple[Joint, ...]:
        """The arm's joints in the order of the station's home posture; none without an arm."""
        if self.robot != "arm":
            return ()
        model = self.plant.GetModelInstanceByName("arm")
        return tuple(actuator.joint() for actuator in joint_actuators(self.plant, model))

    @property
    def body_names(self) -> dict[BodyIndex, str]:
        """Display names of bodies: instances, obstacles, `table`, and robot links."""
        objects = {**self.free, **self.standing, **self.fixed}
        names = {index: name for name, index in objects.items()}
        links = {i: self.plant.get_body(i).name() for i in self.robot_bodies}
        return names | links | {self.table: "table"}

    def X_WO(self, instance: str) -> Array:
        """Pose (4, 4) of an instance in the document."""
        if instance not in self._X_WO:
            self._X_WO[instance] = instance_pose(self.scene, self.station, instance)
        return self._X_WO[instance].copy()


def instance_pose(scene: Scene, station: Station, instance: str) -> Array:
    """Pose `X_WO` (4, 4) of an instance in the documents."""
    return station.document.X_WS.matrix() @ scene.X_SO(instance)


class HandHandle:
    """Handle on the hand of a diagram built with `robot="hand"` or `robot="arm"`.

    Args:
        station_diagram: the diagram.

    Attributes:
        document: the hand's document.
        body: the hand's body H.
        fingers, joints, pads: bodies, joints and pads of the two fingers, in the document's order.
    """

    def __init__(self, station_diagram: StationDiagram) -> None:
        plant, hand = station_diagram.plant, station_diagram.station.hand
        self.document = hand
        self._plant = plant
        model = plant.GetModelInstanceByName("hand")
        inspector = station_diagram.scene_graph.model_inspector()
        found = find_hand(plant, inspector, hand, model)
        self.body, self.joints, self.pads = found.body, found.joints, found.pads
        self.fingers = (found.fingers[0].index(), found.fingers[1].index())
        driven = [plant.get_joint_actuator(i).joint() for i in plant.GetJointActuatorIndices(model)]
        self._order = [found.joints.index(joint) for joint in driven]
        self._X_HG = hand.X_HG.matrix()
        self._X_GH = inverse(self._X_HG)

    def set_fingers(self, plant_context: Context, closed: float) -> None:
        """Sets the positions of the fingers, at rest.

        Args:
            plant_context: the plant's part of the Context.
            closed: how far the fingers are closed, from 0 (open) to 1 (pads together).
        """
        for joint, finger in zip(self.joints, self.document.fingers, strict=True):
            joint.set_translation(plant_context, finger.position(closed))
            joint.set_translation_rate(plant_context, 0.0)

    def closing_command(self) -> Array:
        """Desired state (4,) that closes the hand: positions and velocities of the two fingers, in
        the order of the model's actuators."""
        fingers = [self.document.fingers[i] for i in self._order]
        speed = self.document.closing_speed
        direction = [np.sign(f.closed - f.open) for f in fingers]
        return np.array([f.closed for f in fingers] + [speed * d for d in direction])

    def opening_command(self) -> Array:
        """Desired state (4,) that opens the hand and presses the fingers against their stops, in
        the order of `closing_command`."""
        fingers = [self.document.fingers[i] for i in self._order]
        return np.array([f.open for f in fingers] + list(-self.closing_command()[2:]))

    def finger_speed(self, plant_context: Context) -> float:
        """Speed of the faster finger [m/s]."""
        speed: float = max(abs(joint.get_translation_rate(plant_context)) for joint in self.joints)
        return speed

    def X_WG(self, plant_context: Context) -> Array:
        """Current grasp frame (4, 4) in the world."""
        return self.X_WH(plant_context) @ self._X_HG

    def X_WH(self, plant_context: Context) -> Array:
        """Current pose (4, 4) of the hand's body in the world."""
        X_WH: Array = self._plant.EvalBodyPoseInWorld(plant_context, self.body).GetAsMatrix4()
        return X_WH


UP_DIRECTION = np.array((0.0, 0.0, 1.0))  # Unit vector in the world.


class FloatingHand(HandHandle):
    """Handle on the hand of a diagram built with `robot="hand"`.

    Args:
        station_diagram: the diagram.

    Attributes:
        document, body, fingers, joints, pads: see `HandHandle`.
        lift: the joint that carries the hand along a straight segment.

    Raises:
        InvalidInputError: the diagram has no floating hand.
    """

    def __init__(self, station_diagram: StationDiagram) -> None:
        if station_diagram.robot != "hand":
            raise InvalidInputError(
                f"the diagram was built with robot={station_diagram.robot!r}; build it with 'hand'"
            )
        super().__init__(station_diagram)
        plant = station_diagram.plant
        self.lift = plant.GetJointByName("lift")
        self._base = plant.GetFrameByName("lift_base")
        self._mount = plant.GetFrameByName("lift_mount")

    def place(
        self,
        plant_context: Context,
        X_WG: Array,
        closed: float = 0.0,
        direction_W: Array = UP_DIRECTION,
    ) -> None:
        """Places the grasp frame at `X_WG` (4, 4), with the lift at 0 and all at rest.

        Args:
            plant_context: the plant's part of the Context.
            X_WG: grasp in the world.
            closed: how far the fingers are closed, from 0 (open) to 1 (pads together).
            direction_W: (3,) unit vector of the lift's direction.
        """
        self._set_mount(plant_context, X_WG @ self._X_GH, direction_W)
        self.set_fingers(plant_context, closed)

    def set_lift_direction(self, plant_context: Context, direction_W: Array) -> None:
        """Sets another direction (3,) of the lift from the hand's current pose, with the hand at
        rest; the state of the fingers is kept."""
        self._set_mount(plant_context, self.X_WH(plant_context), direction_W)

    def travelled(self, plant_context: Context) -> float:
        """Distance of the hand along the lift [m]."""
        return float(self.lift.get_translation(plant_context))

    def _set_mount(self, plant_context: Context, X_WH: Array, direction_W: Array) -> None:
        # The lift joint moves along z of its frames L: the base has the hand's position, and the
        # mount compensates the hand's orientation.
        R_WL = RotationMatrix(_rotation_from_z(direction_W))
        R_WH = RotationMatrix(X_WH[:3, :3])
        self._base.SetPoseInParentFrame(plant_context, RigidTransform(R_WL, X_WH[:3, 3]))
        R_HL = R_WH.inverse().multiply(R_WL)
        self._mount.SetPoseInParentFrame(plant_context, RigidTransform(R_HL, np.zeros(3)))
        self.lift.set_translation(plant_context, 0.0)
        self.lift.set_translation_rate(plant_context, 0.0)


def _rotation_from_z(u: Array) -> Array:
    """A rotation (3, 3) that maps z to a unit vector (3,); the identity for z itself."""
    if u[2] < 0.0:
        return _rotation_from_z(-u) @ np.diag([1.0, -1.0, -1.0])
    v = np.array((-u[1], u[0], 0.0))
    cross = np.array(((0.0, -v[2], v[1]), (v[2], 0.0, -v[0]), (-v[1], v[0], 0.0)))
    turned: Array = np.eye(3) + cross + cross @ cross / (1.0 + u[2])
    return turned


class MountedHand(HandHandle):
    """Handle on the hand of a diagram built with `robot="arm"`, and on the arm that carries it.

    Args:
        station_diagram: the diagram.

    Attributes:
        document, body, fingers, joints, pads: see `HandHandle`.
        arm: the arm's model instance; n joints in the order of the station's home posture.
        links: bodies of the arm without the hand.

    Raises:
        InvalidInputError: the diagram has no arm.
    """

    def __init__(self, station_diagram: StationDiagram) -> None:
        if station_diagram.robot != "arm":
            raise InvalidInputError(
                f"the diagram was built with robot={station_diagram.robot!r}; build it with 'arm'"
            )
        super().__init__(station_diagram)
        self.arm = self._plant.GetModelInstanceByName("arm")
        self.links: frozenset[BodyIndex] = frozenset(self._plant.GetBodyIndices(self.arm))
        self._positions = [joint.position_start() for joint in station_diagram.arm_joints]
        self._velocities = [joint.velocity_start() for joint in station_diagram.arm_joints]

    def place(self, plant_context: Context, q: Array, closed: float = 0.0) -> None:
        """Sets the arm's positions to `q` (n,), with all at rest.

        Args:
            plant_context: the plant's part of the Context.
            q: joint positions [rad].
            closed: how far the fingers are closed, from 0 (open) to 1 (pads together).
        """
        self.set_arm(plant_context, q)
        velocities = self._plant.GetVelocities(plant_context)
        velocities[self._velocities] = 0.0
        self._plant.SetVelocities(plant_context, velocities)
        self.set_fingers(plant_context, closed)

    def set_arm(self, plant_context: Context, q: Array) -> None:
        """Sets only the arm's positions to `q` (n,) [rad]."""
        positions = self._plant.GetPositions(plant_context)
        positions[self._positions] = q
        self._plant.SetPositions(plant_context, positions)

    def q(self, plant_context: Context) -> Array:
        """Current joint positions (n,) [rad]."""
        positions: Array = self._plant.GetPositions(plant_context)[self._positions]
        return positions
