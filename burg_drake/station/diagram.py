"""The one place that builds Drake diagrams: a scene on a station, with a hand, an arm or neither.

Ports of the diagram (MODEL is `hand`, `arm` or `lift`):

    inputs   MODEL.desired_state      positions and velocities for the joint servos
    outputs  state, MODEL.state, contact_results, body_poses, geometry_query,
             camera.NAME.color_image, .depth_image, .label_image (with cameras=True)

An input that is not connected leaves its joints without actuation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    Box,
    HydroelasticContactRepresentation,
    MeshcatVisualizer,
    ProximityProperties,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import (
    ContactModel,
    CoulombFriction,
    DiscreteContactApproximation,
    MultibodyPlant,
)
from pydrake.multibody.tree import (
    BodyIndex,
    FixedOffsetFrame,
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    RigidBody,
    SpatialInertia,
)
from pydrake.planning import RobotDiagram, RobotDiagramBuilder

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array
from burg_drake.scene.scene import Scene
from burg_drake.station.cameras import add_cameras
from burg_drake.station.engine import ENGINES, Engine
from burg_drake.station.station import Station

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat, SceneGraph

Robot = Literal["arm", "hand", "none"]

ROBOT_MODELS = ("hand", "arm", "lift")
"""Names of the robot's model instances in every plant."""
TABLE_MODULUS = 1e7
"""Hydroelastic modulus of table and obstacles [Pa]: sinks micrometres under household objects."""
DISSIPATION = 5.0
"""Hunt-Crossley dissipation of table and obstacles [s/m]."""
FINGER_DAMPING = 1000.0
"""Velocity gain of a finger [N s/m]. Without position gain and with the effort limited, this is a
servo that moves at the commanded speed and presses with the limit."""
LIFT_DAMPING = 1e6
"""Velocity gain of the floating hand's lift joint [N s/m]; holds a speed to 1e-5 m/s."""
ARM_STIFFNESS = np.array([4500.0, 4500.0, 3500.0, 3500.0, 2000.0, 2000.0, 1000.0])
"""Position gains of a seven-joint arm [Nm/rad], falling towards the wrist."""
ARM_DAMPING_TIME = 0.05
"""Velocity gain over position gain [s]."""

TABLE_COLOR = (0.82, 0.79, 0.74, 1.0)
BOARD_COLOR = (0.97, 0.97, 0.95, 1.0)
OBSTACLE_COLOR = (0.55, 0.58, 0.62, 1.0)
BOARD_THICKNESS = 5e-4


@dataclass(frozen=True, eq=False)
class StationDiagram:
    """A built diagram and the names to find things in it.

    Attributes:
        diagram: the Drake diagram; keep it alive while its plant is used.
        scene, station, robot, engine: what it was built from.
        free: body of each free instance, by name.
        fixed: bodies of background instances and obstacles, by name.
        table: the table's body.
        robot_bodies: all bodies of hand and arm.
    """

    diagram: RobotDiagram
    scene: Scene
    station: Station
    robot: Robot
    engine: Engine
    free: dict[str, BodyIndex]
    fixed: dict[str, BodyIndex]
    table: BodyIndex
    robot_bodies: tuple[BodyIndex, ...]

    @property
    def plant(self) -> MultibodyPlant:
        """The plant, finalized."""
        return self.diagram.plant()

    @property
    def scene_graph(self) -> SceneGraph:
        """The scene graph."""
        return self.diagram.scene_graph()

    def X_WO(self, instance: str) -> Array:
        """(4, 4) pose at which the document places an instance."""
        return instance_pose(self.scene, self.station, instance)


def instance_pose(scene: Scene, station: Station, instance: str) -> Array:
    """`X_WO` (4, 4) of an instance as the documents place it."""
    return station.document.X_WS.matrix() @ scene.X_SO(instance)


def build_station_diagram(
    scene: Scene,
    station: Station,
    *,
    robot: Robot = "arm",
    engine: Engine = ENGINES["standard"],
    meshcat: Meshcat | None = None,
    cameras: bool = False,
) -> StationDiagram:
    """Builds the diagram of a scene on a station.

    Args:
        scene: what stands on the board.
        station: robot, table, board pose and cameras.
        robot: `arm` mounts the hand on the station's arm. `hand` lets it hang on one prismatic
            joint `lift` along world z between the frames `lift_base` (in the world) and
            `lift_mount` (on the hand), which are set per grasp through the Context. `none` leaves
            the robot out.
        engine: time step and contact settings.
        meshcat: where to show the diagram live, if anywhere.
        cameras: add the station's cameras; needs the renderer's system libraries.

    Returns:
        The diagram. In its default context all stands as the documents say, the hand is open and
        the arm is in its home posture.

    Raises:
        InvalidInputError: `arm` without an arm in the station, or a home posture that does not
            fit the arm.
        MissingDependencyError: cameras without the renderer's system libraries.
    """
    builder = RobotDiagramBuilder(time_step=engine.time_step)
    plant = builder.plant()
    builder.parser().package_map().Remove("drake_models")
    _set_engine(plant, engine)

    table = _add_table(plant, station)
    _add_board(plant, scene, station)
    free = {name: _add_instance(builder, scene, name) for name in scene.instances}
    fixed = {name: _add_instance(builder, scene, name) for name in scene.background}
    for name, body in fixed.items():
        X_WO = instance_pose(scene, station, name)
        plant.WeldFrames(plant.world_frame(), body.body_frame(), RigidTransform(X_WO))
    fixed |= _add_obstacles(plant, station)
    models = _add_robot(builder, station, robot)

    plant.Finalize()
    for name, body in free.items():
        X_WO = instance_pose(scene, station, name)
        plant.SetDefaultFloatingBaseBodyPose(body, RigidTransform(X_WO))
    _set_default_posture(plant, station, models)

    if cameras:
        add_cameras(builder, station)
    if meshcat is not None:
        MeshcatVisualizer.AddToBuilder(builder.builder(), builder.scene_graph(), meshcat)
    _export_ports(builder, models)
    return StationDiagram(
        diagram=builder.Build(),
        scene=scene,
        station=station,
        robot=robot,
        engine=engine,
        free={name: body.index() for name, body in free.items()},
        fixed={name: body.index() for name, body in fixed.items()},
        table=table.index(),
        robot_bodies=tuple(i for m in models.values() for i in plant.GetBodyIndices(m)),
    )


def _set_engine(plant: MultibodyPlant, engine: Engine) -> None:
    plant.set_contact_model(
        {
            "hydroelastic_with_fallback": ContactModel.kHydroelasticWithFallback,
            "point": ContactModel.kPoint,
        }[engine.contact_model]
    )
    plant.set_discrete_contact_approximation(
        {
            "lagged": DiscreteContactApproximation.kLagged,
            "similar": DiscreteContactApproximation.kSimilar,
            "sap": DiscreteContactApproximation.kSap,
        }[engine.contact_approximation]
    )
    plant.set_contact_surface_representation(
        {
            "polygon": HydroelasticContactRepresentation.kPolygon,
            "triangle": HydroelasticContactRepresentation.kTriangle,
        }[engine.contact_surface]
    )


def _compliant_box(size: Array, friction: float) -> ProximityProperties:
    properties = ProximityProperties()
    AddCompliantHydroelasticProperties(float(np.max(size)), TABLE_MODULUS, properties)
    AddContactMaterial(
        dissipation=DISSIPATION, friction=CoulombFriction(friction, friction), properties=properties
    )
    return properties


def _add_box(
    plant: MultibodyPlant, name: str, X_WB: Array, size: Array, friction: float, color: tuple
) -> RigidBody:
    """A box welded to the world as a body of its own: with collision geometry on the world body
    itself, locking a joint crashes (drake#24773)."""
    instance = plant.AddModelInstance(name)
    body = plant.AddRigidBody(name, instance, SpatialInertia.SolidBoxWithMass(1.0, *size))
    box = Box(*size)
    plant.RegisterCollisionGeometry(
        body, RigidTransform(), box, "collision", _compliant_box(size, friction)
    )
    plant.RegisterVisualGeometry(body, RigidTransform(), box, "visual", np.array(color))
    plant.WeldFrames(plant.world_frame(), body.body_frame(), RigidTransform(X_WB))
    return body


def _add_table(plant: MultibodyPlant, station: Station) -> RigidBody:
    table = station.document.table
    X_WB = np.eye(4)
    X_WB[:3, 3] = (*table.center, -table.size[2] / 2)
    return _add_box(plant, "table", X_WB, np.array(table.size), table.friction, TABLE_COLOR)


def _add_board(plant: MultibodyPlant, scene: Scene, station: Station) -> None:
    """The printed sheet, to look at only."""
    size = np.array([*scene.board.size, BOARD_THICKNESS])
    X_SB = np.eye(4)
    X_SB[:3, 3] = (size[0] / 2, size[1] / 2, -BOARD_THICKNESS / 4)
    X_WB = station.document.X_WS.matrix() @ X_SB
    instance = plant.AddModelInstance("board")
    body = plant.AddRigidBody("board", instance, SpatialInertia.SolidBoxWithMass(1.0, *size))
    plant.RegisterVisualGeometry(
        body, RigidTransform(), Box(*size), "visual", np.array(BOARD_COLOR)
    )
    plant.WeldFrames(plant.world_frame(), body.body_frame(), RigidTransform(X_WB))


def _add_obstacles(plant: MultibodyPlant, station: Station) -> dict[str, RigidBody]:
    friction = station.document.table.friction
    return {
        name: _add_box(plant, name, box.X_WB.matrix(), np.array(box.size), friction, OBSTACLE_COLOR)
        for name, box in station.document.background.items()
    }


def _add_instance(builder: RobotDiagramBuilder, scene: Scene, name: str) -> RigidBody:
    """Parses the object's SDF; the model instance goes by the name of the scene's instance."""
    plant, parser = builder.plant(), builder.parser()
    parser.SetAutoRenaming(True)
    if plant.HasModelInstanceNamed(name) or name in ROBOT_MODELS:
        raise InvalidInputError(
            f"{scene.path}: instance name {name!r} is taken by the station; choose another"
        )
    (model,) = parser.AddModels(str(scene.library.path(scene.entry(name).sdf)))
    plant.RenameModelInstance(model, name)
    return plant.GetBodyByName("body", model)


def _add_robot(
    builder: RobotDiagramBuilder, station: Station, robot: Robot
) -> dict[str, ModelInstanceIndex]:
    """Adds hand and arm; returns their model instances by role."""
    if robot == "none":
        return {}
    plant, parser = builder.plant(), builder.parser()
    parser.SetAutoRenaming(True)
    (hand,) = parser.AddModels(str(station.hand_model))
    body = plant.GetBodyByName(station.hand.body, hand)
    for finger in station.hand.fingers:
        actuator = plant.GetJointActuatorByName(finger.joint, hand)
        actuator.set_controller_gains(PdControllerGains(p=0.0, d=FINGER_DAMPING))
        actuator.set_effort_limit(station.hand.force)
    plant.RenameModelInstance(hand, "hand")
    models = {"hand": hand}
    if robot == "hand":
        models["lift"] = _add_lift(plant, body)
    else:
        models["arm"] = _add_arm(builder, station, body)
    for model in models.values():
        plant.set_gravity_enabled(model, False)
    return models


def _add_lift(plant: MultibodyPlant, hand: RigidBody) -> ModelInstanceIndex:
    lift = plant.AddModelInstance("lift")
    base = plant.AddFrame(
        FixedOffsetFrame("lift_base", plant.world_frame(), RigidTransform(), lift)
    )
    mount = plant.AddFrame(
        FixedOffsetFrame("lift_mount", hand.body_frame(), RigidTransform(), lift)
    )
    joint = plant.AddJoint(PrismaticJoint("lift", base, mount, np.array([0.0, 0.0, 1.0])))
    actuator = plant.AddJointActuator("lift", joint)
    actuator.set_controller_gains(PdControllerGains(p=0.0, d=LIFT_DAMPING))
    return lift


def _add_arm(builder: RobotDiagramBuilder, station: Station, hand: RigidBody) -> ModelInstanceIndex:
    arm = station.document.arm
    if arm is None:
        raise InvalidInputError(
            f"station {station.name!r} ({station.path}) has no arm; add an 'arm:' section,"
            " or use the hand alone"
        )
    plant = builder.plant()
    (model,) = builder.parser().AddModels(str(station.arm_model))
    plant.RenameModelInstance(model, "arm")
    base = plant.GetFrameByName(arm.base, model)
    plant.WeldFrames(plant.world_frame(), base, RigidTransform(arm.X_WA.matrix()))
    flange = plant.GetFrameByName(arm.flange, model)
    plant.WeldFrames(flange, hand.body_frame(), RigidTransform(arm.X_FH.matrix()))
    actuators = list(_arm_actuators(plant, model))
    if len(arm.home) != len(actuators):
        raise InvalidInputError(
            f"{station.path}: arm.home has {len(arm.home)} joint angles; the arm has"
            f" {len(actuators)} joints"
        )
    stiffness = np.resize(ARM_STIFFNESS, len(actuators))
    for actuator, p in zip(actuators, stiffness, strict=True):
        actuator.set_controller_gains(PdControllerGains(p=p, d=ARM_DAMPING_TIME * p))
    return model


def _arm_actuators(plant: MultibodyPlant, model: ModelInstanceIndex):  # type: ignore[no-untyped-def]
    """Actuators of a model in the order of its joints; works before Finalize too."""
    for index in plant.GetJointIndices(model):
        joint = plant.get_joint(index)
        if joint.num_velocities() == 1:
            yield plant.GetJointActuatorByName(joint.name(), model)


def _set_default_posture(
    plant: MultibodyPlant, station: Station, models: dict[str, ModelInstanceIndex]
) -> None:
    if "hand" in models:
        for finger in station.hand.fingers:
            plant.GetJointByName(finger.joint, models["hand"]).set_default_translation(finger.open)
    if "arm" in models and station.document.arm is not None:
        joints = [a.joint() for a in _arm_actuators(plant, models["arm"])]
        for joint, q in zip(joints, station.document.arm.home, strict=True):
            low, high = joint.position_lower_limits()[0], joint.position_upper_limits()[0]
            if not low <= q <= high:
                raise InvalidInputError(
                    f"{station.path}: arm.home puts {joint.name()} at {q:g} rad; its range is"
                    f" {low:g} to {high:g}"
                )
            joint.set_default_angle(q)


def _export_ports(builder: RobotDiagramBuilder, models: dict[str, ModelInstanceIndex]) -> None:
    plant, system = builder.plant(), builder.builder()
    for role, model in models.items():
        system.ExportInput(plant.get_desired_state_input_port(model), f"{role}.desired_state")
        system.ExportOutput(plant.get_state_output_port(model), f"{role}.state")
    system.ExportOutput(plant.get_state_output_port(), "state")
    system.ExportOutput(plant.get_contact_results_output_port(), "contact_results")
    system.ExportOutput(plant.get_body_poses_output_port(), "body_poses")
    system.ExportOutput(builder.scene_graph().get_query_output_port(), "geometry_query")
