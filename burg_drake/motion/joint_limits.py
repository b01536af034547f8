"""Limits of the joints of an arm: position, velocity, acceleration, jerk and torque."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from burg_drake.core import Array, InvalidInputError
from burg_drake.motion.numeric_ik import ArmKinematics
from burg_drake.motion.panda_ik import PandaIk
from burg_drake.station import StationDiagram, joint_actuators


@dataclass(frozen=True, eq=False)
class ArmLimits:
    """Limits of n joints; the same in both directions.

    Attributes:
        lower, upper: (n,) positions [rad or m].
        velocity: (n,) [rad/s or m/s].
        acceleration: (n,) [rad/s^2 or m/s^2].
        jerk: (n,) [rad/s^3 or m/s^3].
        torque: (n,) [Nm or N]; infinite where the model has none.
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    jerk: Array
    torque: Array

    def __post_init__(self) -> None:
        if not (self.lower <= self.upper).all():
            raise InvalidInputError(
                f"position limits of an arm are {self.lower.tolist()} to {self.upper.tolist()};"
                " give a lower and a higher number for each joint"
            )
        if not (self.torque >= 0.0).all():
            raise InvalidInputError(
                f"torque limits of an arm are {self.torque.tolist()}; each must be at least 0, or"
                " inf"
            )
        for name in ("velocity", "acceleration", "jerk"):
            value = getattr(self, name)
            if value.shape != self.lower.shape or not (np.isfinite(value) & (value > 0.0)).all():
                raise InvalidInputError(
                    f"{name} limits of an arm of {len(self.lower)} joints are {value.tolist()};"
                    " give one finite number above 0 for each joint"
                )

    @classmethod
    def of(cls, diagram: StationDiagram, kinematics: ArmKinematics) -> ArmLimits:
        """The limits of a station's arm.

        The station document takes precedence over the model. If neither states acceleration or
        jerk, an arm with the Panda's kinematics gets Franka's values; another arm gets those that
        reach full speed in 0.5 s and full acceleration in 0.1 s.

        Args:
            diagram: a diagram with the arm.
            kinematics: the kinematics of the arm.

        Raises:
            InvalidInputError: a joint has no velocity limit, or a limit is invalid.
        """
        # rad/s^2 and rad/s^3: Franka Control Interface, "Limits for Panda", joint space.
        panda_acceleration = (15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0)
        panda_jerk = (7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0)
        # Seconds to full speed. Conservative: industrial arms take half of it or less.
        acceleration_time = 0.5
        jerk_time = 0.1  # Seconds to full acceleration.
        arm = diagram.station.document.arm
        assert arm is not None and diagram.robot == "arm"
        panda = PandaIk.of(kinematics) is not None
        joints, where = diagram.arm_joints, f"{diagram.station.path}: arm"
        n = len(joints)
        velocity = _limits_from_document(arm.velocity, n, f"{where}.velocity")
        if velocity is None:
            velocity = _velocity_limits_of_model(diagram)
        acceleration = _limits_from_document(arm.acceleration, n, f"{where}.acceleration")
        if acceleration is None:
            modelled = np.array([joint.acceleration_upper_limits()[0] for joint in joints])
            usual = np.array(panda_acceleration) if panda else velocity / acceleration_time
            acceleration = np.where(np.isfinite(modelled), modelled, usual)
        jerk = _limits_from_document(arm.jerk, n, f"{where}.jerk")
        if jerk is None:
            jerk = np.array(panda_jerk) if panda else acceleration / jerk_time
        model = diagram.plant.GetModelInstanceByName("arm")
        torque = np.array([a.effort_limit() for a in joint_actuators(diagram.plant, model)])
        lower, upper = kinematics.lower, kinematics.upper
        return cls(lower, upper, velocity, acceleration, jerk, torque)

    def slowed(self, speed: float) -> ArmLimits:
        """Limits that a motion within these keeps once it is stretched in time by 1 / `speed`."""
        return replace(
            self,
            velocity=self.velocity * speed,
            acceleration=self.acceleration * speed**2,
            jerk=self.jerk * speed**3,
        )

    def scaled_down(self, velocity_share: float, ramp: float) -> ArmLimits:
        """Limits with a share of the velocity, and with jerk that takes at least `ramp` [s] to
        build up the largest acceleration."""
        return replace(
            self,
            velocity=self.velocity * velocity_share,
            jerk=np.minimum(self.jerk, self.acceleration / ramp),
        )

    def time_scale(self, peaks: tuple[Array, Array, Array]) -> float:
        """Factor by which a motion with these peaks, (n,) each, has to be stretched in time to keep
        the limits; below 1 if it could be faster."""
        velocity, acceleration, jerk = peaks
        return float(
            max(
                (velocity / self.velocity).max(),
                (acceleration / self.acceleration).max() ** (1.0 / 2.0),
                (jerk / self.jerk).max() ** (1.0 / 3.0),
            )
        )


def _velocity_limits_of_model(diagram: StationDiagram) -> Array:
    """Velocity limits (n,) of the model; raises an error if a joint has none."""
    joints = diagram.arm_joints
    velocity = np.array([joint.velocity_upper_limits()[0] for joint in joints])
    for joint, limit in zip(joints, velocity, strict=True):
        if not 0.0 < limit < np.inf:
            raise InvalidInputError(
                f"{diagram.station.arm_model}: joint {joint.name()!r} has no velocity limit; add"
                " it to the model, or give the limits of all joints as arm.velocity in"
                f" {diagram.station.path}"
            )
    return velocity


def _limits_from_document(values: tuple[float, ...] | None, n: int, where: str) -> Array | None:
    """The limits of a document, as an array."""
    if values is None:
        return None
    if len(values) != n:
        raise InvalidInputError(f"{where} has {len(values)} numbers, but the arm has {n} joints")
    return np.array(values)
