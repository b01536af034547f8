"""The robot in a plant: the hand on the arm or on a vertical joint, with servos and posture."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    JointActuator,
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    RigidBody,
)
from pydrake.planning import RobotDiagramBuilder

from burg_drake.core import Array, InvalidInputError, UnknownNameError, suggest_names
from burg_drake.station.hand_model import add_hand, check_hand
from burg_drake.station.model_file import add_models, require_free_model, without_hydroelastic
from burg_drake.station.station_document import Station

Robot = Literal["arm", "hand", "none"]

RobotModels = dict[str, ModelInstanceIndex]
"""Model instances of the robot by name."""

ROBOT_MODELS = ("hand", "arm", "lift")
"""Names of the robot's model instances."""


def add_robot(
    builder: RobotDiagramBuilder, station: Station, robot: Robot, *, simulated: bool = True
) -> RobotModels:
    """Adds hand and arm with their servos.

    Gravity does not pull them, unless an inverse-dynamics controller will carry the arm's weight;
    see `ArmControl`.

    Args:
        builder: builder whose plant is not finalized.
        station: station with hand and arm.
        robot: part of the robot to add.
        simulated: whether contact will be simulated; some models are not needed for point queries.

    Returns:
        Model instances by role: `hand`, and `arm` or `lift`.

    Raises:
        InvalidInputError: the hand's document does not fit its model, the station has no arm, its
            model cannot be loaded, or its home posture does not fit the arm.
        UnknownNameError: the arm has no such base or flange.
    """
    if robot == "none":
        return {}
    check_hand(station.hand, station.hand_model, station.hand_path, station.packages)
    plant = builder.plant()
    added = add_hand(
        builder, station.hand, station.hand_model, station.packages, simulated=simulated
    )
    plant.RenameModelInstance(added.instance, "hand")
    models = {"hand": added.instance}
    if robot == "hand":
        X_SG = np.diag([1.0, -1.0, -1.0, 1.0])  # down, well above the origin of the board
        X_SG[2, 3] = 0.5
        X_WH = station.hand.X_AH(station.document.X_WS.matrix() @ X_SG)
        models["lift"] = _add_lift(plant, added.body, X_WH)
    else:
        models["arm"] = _add_arm(builder, station, added.body, simulated)
    for model in models.values():
        plant.set_gravity_enabled(model, robot == "arm" and has_inverse_dynamics(station))
    return models


def has_inverse_dynamics(station: Station) -> bool:
    """Whether the station's arm has an inverse-dynamics controller."""
    arm = station.document.arm
    return arm is not None and arm.control.kind == "inverse_dynamics"


def _add_lift(plant: MultibodyPlant, hand: RigidBody, X_WH: Array) -> ModelInstanceIndex:
    damping = 1e6  # N s/m, velocity gain; holds a speed to 1e-5 m/s.
    lift = plant.AddModelInstance("lift")
    at_hand = RigidTransform(X_WH[:3, 3])
    turned_back = RigidTransform(RotationMatrix(X_WH[:3, :3]).inverse(), np.zeros(3))
    base = plant.AddFrame(FixedOffsetFrame("lift_base", plant.world_frame(), at_hand, lift))
    mount = plant.AddFrame(FixedOffsetFrame("lift_mount", hand.body_frame(), turned_back, lift))
    joint = plant.AddJoint(PrismaticJoint("lift", base, mount, np.array([0.0, 0.0, 1.0])))
    actuator = plant.AddJointActuator("lift", joint)
    actuator.set_controller_gains(PdControllerGains(p=0.0, d=damping))
    return lift


def _add_arm(
    builder: RobotDiagramBuilder, station: Station, hand: RigidBody, simulated: bool
) -> ModelInstanceIndex:
    arm = station.document.arm
    if arm is None:
        raise InvalidInputError(
            f"station {station.name!r} ({station.path}) has no arm; add an 'arm:' section,"
            " or use the hand alone"
        )
    assert station.arm_model is not None
    plant = builder.plant()
    try:
        path, packages = station.arm_model, station.packages
        edit = None if simulated else without_hydroelastic
        (model,) = add_models(builder.parser(), path, packages, edit=edit)
    except InvalidInputError:
        raise
    except (RuntimeError, ValueError) as error:
        raise InvalidInputError(
            f"{station.path}: arm.model: {station.arm_model} cannot be loaded as one robot"
            f" ({' '.join(str(error).split())})"
        ) from error
    require_free_model(plant, model, station.arm_model)
    plant.RenameModelInstance(model, "arm")
    base = _find_arm_frame(plant, model, station, "base", arm.base)
    plant.WeldFrames(plant.world_frame(), base, RigidTransform(arm.X_WA.matrix()))
    flange = _find_arm_frame(plant, model, station, "flange", arm.flange)
    plant.WeldFrames(flange, hand.body_frame(), RigidTransform(arm.X_FH.matrix()))
    actuators = joint_actuators(plant, model)
    driven = {actuator.joint().index() for actuator in actuators}
    idle = [
        joint.name()
        for joint in map(plant.get_joint, plant.GetJointIndices(model))
        if joint.index() not in driven and joint.type_name() != "weld"
    ]
    if idle:
        raise InvalidInputError(
            f"{station.arm_model}: {', '.join(idle)} cannot be driven; in a URDF each"
            " joint of the arm needs a <transmission>, in an SDF an effort limit"
        )
    if len(arm.home) != len(actuators):
        raise InvalidInputError(
            f"{station.path}: arm.home has {len(arm.home)} joint angles; the arm has"
            f" {len(actuators)} joints"
        )
    if arm.control.kind == "impedance":
        gains = arm.control.gains(len(actuators), f"{station.path}: arm.control")
        for actuator, p, d in zip(actuators, *gains, strict=True):
            actuator.set_controller_gains(PdControllerGains(p=p, d=d))
    return model


def _find_arm_frame(
    plant: MultibodyPlant, arm: ModelInstanceIndex, station: Station, key: str, name: str
) -> Frame:
    """The arm's frame that the station names at a key."""
    if not plant.HasFrameNamed(name, arm):
        frames = [plant.get_frame(index).name() for index in plant.GetFrameIndices(arm)]
        # Suffixes of the frames that Drake's parser adds for each joint.
        frames = [f for f in frames if not f.startswith("__")]
        frames = [f for f in frames if not f.endswith(("_parent", "_child"))]
        raise UnknownNameError(
            f"{station.path}: arm.{key}: {station.arm_model} has no frame {name!r};"
            f" {suggest_names(name, frames)}"
        )
    return plant.GetFrameByName(name, arm)


def joint_actuators(plant: MultibodyPlant, model: ModelInstanceIndex) -> list[JointActuator]:
    """Actuators of a model in the order of its joints; works before Finalize, too."""
    actuators = [plant.get_joint_actuator(i) for i in plant.GetJointActuatorIndices()]
    own = [a for a in actuators if a.joint().model_instance() == model]
    return sorted(own, key=lambda a: int(a.joint().index()))


def set_default_posture(plant: MultibodyPlant, station: Station, models: RobotModels) -> None:
    """Opens the hand and puts the arm into its home posture in default contexts.

    Raises:
        InvalidInputError: the home posture is beyond a joint limit.
    """
    if "hand" in models:
        for finger in station.hand.fingers:
            plant.GetJointByName(finger.joint, models["hand"]).set_default_translation(finger.open)
    if "arm" in models and station.document.arm is not None:
        joints = [a.joint() for a in joint_actuators(plant, models["arm"])]
        for joint, q in zip(joints, station.document.arm.home, strict=True):
            low, high = joint.position_lower_limits()[0], joint.position_upper_limits()[0]
            if not low <= q <= high:
                raise InvalidInputError(
                    f"{station.path}: arm.home puts {joint.name()} at {q:g} rad; its range is"
                    f" {low:g} to {high:g}"
                )
            joint.set_default_positions(np.array([q]))
