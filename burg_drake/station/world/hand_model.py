"""Adds a hand to a plant as its document describes it: servos, force limits, coupling."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from pydrake.geometry import GeometryId, SceneGraphInspector
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    JointActuator,
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    RigidBody,
)
from pydrake.planning import RobotDiagramBuilder

from burg_drake.core import InvalidInputError, nearest
from burg_drake.core.paths import NO_PACKAGES, Packages
from burg_drake.station.document import Finger, Hand
from burg_drake.station.world.model_file import (
    add_models,
    require_loose,
    without_hydroelastic,
)

STALL = 1.25
"""Force that a finger's servo asks for when it stands still, over the force of the grip. A velocity
servo whose effort is limited moves at the commanded speed and presses with the limit, if its gain
times that speed is above the limit."""


@dataclass(frozen=True, eq=False)
class HandModel:
    """A hand in a plant.

    Attributes:
        instance: its model instance.
        body: the link that the arm carries.
        fingers, joints, pads: of the two fingers, in the order of the document.
    """

    instance: ModelInstanceIndex
    body: RigidBody
    fingers: tuple[RigidBody, RigidBody]
    joints: tuple[PrismaticJoint, PrismaticJoint]
    pads: tuple[GeometryId, GeometryId]


def add_hand(
    builder: RobotDiagramBuilder,
    hand: Hand,
    path: Path,
    packages: Packages = NO_PACKAGES,
    *,
    simulated: bool = True,
) -> HandModel:
    """Adds a hand with its servos.

    Args:
        builder: its plant is not finalized.
        hand: the document.
        path: the model file.
        packages: what a station says of packages.
        simulated: whether contact will be simulated.

    Raises:
        InvalidInputError: the model cannot be loaded, is fixed in the world, lacks what the
            document names, or is weaker or slower than the document says.
    """
    plant = builder.plant()
    constraints = plant.num_constraints()
    try:
        edit = None if simulated else without_hydroelastic
        (instance,) = add_models(builder.parser(), path, packages, edit=edit)
    except InvalidInputError:
        raise
    except (RuntimeError, ValueError) as error:
        raise InvalidInputError(
            f"hand {hand.name!r}: {path} cannot be loaded as one model"
            f" ({' '.join(str(error).split())})"
        ) from error
    require_loose(plant, instance, path)
    found = find_hand(plant, builder.scene_graph().model_inspector(), hand, instance)
    for finger, joint in zip(hand.fingers, found.joints, strict=True):
        _add_servo(plant, hand, finger, joint)
    driven = [a.joint().name() for a in _actuators(plant) if a.model_instance() == instance]
    if len(driven) != 2:
        raise InvalidInputError(
            f"hand {hand.name!r}: {hand.model} has actuators for "
            f"{', '.join(sorted(driven))}; only the joints of the two fingers may have"
            " one"
        )
    if hand.coupled and plant.num_constraints() == constraints:
        first, second = hand.fingers
        ratio = (first.open - first.closed) / (second.open - second.closed)
        offset = first.closed - ratio * second.closed
        plant.AddCouplerConstraint(*found.joints, ratio, offset)
    return found


def find_hand(
    plant: MultibodyPlant,
    inspector: SceneGraphInspector,
    hand: Hand,
    instance: ModelInstanceIndex,
) -> HandModel:
    """Looks up what a document names in a plant.

    Raises:
        InvalidInputError: the model has no such link, joint or pad.
    """
    bodies = {b.name(): b for b in map(plant.get_body, plant.GetBodyIndices(instance))}
    joints = {j.name(): j for j in map(plant.get_joint, plant.GetJointIndices(instance))}
    sliding = {name: j for name, j in joints.items() if isinstance(j, PrismaticJoint)}

    def pad(index: int, finger: Finger, body: RigidBody) -> GeometryId:
        geometries = {
            inspector.GetName(g).split("::")[-1]: g
            for g in plant.GetCollisionGeometriesForBody(body)
        }
        _check_name(hand, f"fingers[{index}].pad", finger.pad, geometries)
        return geometries[finger.pad]

    _check_name(hand, "body", hand.body, bodies)
    for i, finger in enumerate(hand.fingers):
        _check_name(hand, f"fingers[{i}].body", finger.body, bodies)
        if finger.joint in joints and finger.joint not in sliding:
            kind = joints[finger.joint].type_name()
            raise InvalidInputError(
                f"hand {hand.name!r}: fingers[{i}].joint {finger.joint!r} is {kind} in its model"
                f" {hand.model}; fingers have to be on prismatic joints: model a hand whose fingers"
                " turn by two that slide, with the pads of the real one"
                " (https://burg-drake.github.io/burg_drake/reference/hands.html)"
            )
        _check_name(hand, f"fingers[{i}].joint", finger.joint, sliding)
    one, other = hand.fingers
    return HandModel(
        instance=instance,
        body=bodies[hand.body],
        fingers=(bodies[one.body], bodies[other.body]),
        joints=(sliding[one.joint], sliding[other.joint]),
        pads=(pad(0, one, bodies[one.body]), pad(1, other, bodies[other.body])),
    )


def _check_name(hand: Hand, key: str, name: str, known: Iterable[str]) -> None:
    if name not in known:
        raise InvalidInputError(
            f"hand {hand.name!r}: {key} {name!r} is not in its model {hand.model};"
            f" {nearest(name, known)}"
        )


def _add_servo(plant: MultibodyPlant, hand: Hand, finger: Finger, joint: PrismaticJoint) -> None:
    """Gives a finger its velocity servo, and an actuator where the model has none."""
    actuator = _actuator(plant, joint)
    if hand.force > actuator.effort_limit():
        raise InvalidInputError(
            f"hand {hand.name!r}: force is {hand.force:g} N, but the effort limit of"
            f" joint {finger.joint!r} in {hand.model} is {actuator.effort_limit():g} N"
        )
    fastest = float(joint.velocity_upper_limits()[0])
    if hand.closing_speed > fastest:
        raise InvalidInputError(
            f"hand {hand.name!r}: closing_speed is {hand.closing_speed:g} m/s, but the"
            f" velocity limit of joint {finger.joint!r} in {hand.model} is {fastest:g}"
            " m/s"
        )
    gain = STALL * hand.force / hand.closing_speed
    actuator.set_controller_gains(PdControllerGains(p=0.0, d=gain))
    actuator.set_effort_limit(hand.force)


def _actuators(plant: MultibodyPlant) -> list[JointActuator]:
    return [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]


def _actuator(plant: MultibodyPlant, joint: PrismaticJoint) -> JointActuator:
    for actuator in _actuators(plant):
        if actuator.joint().index() == joint.index():
            return actuator
    return plant.AddJointActuator(joint.name(), joint)
