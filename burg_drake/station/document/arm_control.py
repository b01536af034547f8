"""How an arm follows its command: the part `arm.control` of a station document."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from burg_drake.core import Array, FieldError, InvalidInputError

ARM_STIFFNESS = np.array([3000.0, 3000.0, 3000.0, 2500.0, 2500.0, 2000.0, 2000.0])
"""[Nm/rad]: the joint impedance to which libfranka's examples set a Panda (`setJointImpedance` in
examples_common.cpp)."""
ARM_DAMPING_TIME = 0.05
"""Velocity gain over position gain of the joint impedance [s]."""
ACCELERATION_KP = 2000.0
"""[1/s^2]: the stiffest of the gains that Drake gives a simulated iiwa (sim_iiwa_driver.cc); its
others go down to 500."""
GAINS = (1e-3, 1e6)
"""Of any kind; no drive is as stiff."""


@dataclass(frozen=True, kw_only=True)
class ArmControl:
    """How the joints of an arm follow their commands in simulation.

    With `impedance` every joint has a spring and a damper of its own, which Drake's solver computes
    as part of a step. Gravity does not pull the robot then: a real one compensates its own weight.
    With `inverse_dynamics` gravity does pull it, and the torque is what a model of arm and hand
    needs for the acceleration `kp` (q_d - q) + `kd` (v_d - v). That model knows nothing of what the
    hand holds. Either way no joint gets more than its effort limit.

    Attributes:
        kind: `impedance`: a spring and a damper for each joint; gravity does not pull the robot.
            `inverse_dynamics`: torques from a model of arm and hand, which knows nothing of what
            the hand holds.
        kp: position gains, one for all joints or one for each: [Nm/rad] with `impedance`, [1/s^2]
            with `inverse_dynamics`.
        kd: velocity gains, one for all joints or one for each: [Nm s/rad] with `impedance`, [1/s]
            with `inverse_dynamics`. If left out, `kp` times 0.05 s with `impedance`, critical
            damping with `inverse_dynamics`.
    """

    kind: Literal["impedance", "inverse_dynamics"] = "impedance"
    kp: tuple[float, ...] | None = None
    kd: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        for name in ("kp", "kd"):
            values = getattr(self, name)
            low, high = GAINS
            if values is not None and not (values and low <= min(values) <= max(values) <= high):
                raise FieldError(
                    f"{name} {list(values)} must be one number, or one for each joint,"
                    f" from {low:g} to {high:g}",
                    name,
                )

    def gains(self, joints: int, where: str) -> tuple[Array, Array]:
        """`kp` and `kd`, (n,) each, of an arm with n joints.

        Args:
            joints: how many.
            where: the document's key, for messages.

        Raises:
            InvalidInputError: there are neither one nor n numbers.
        """
        kp = _of_joints(self.kp, joints, f"{where}.kp")
        kd = _of_joints(self.kd, joints, f"{where}.kd")
        if self.kind == "impedance":
            kp = np.resize(ARM_STIFFNESS, joints) if kp is None else kp
            return kp, ARM_DAMPING_TIME * kp if kd is None else kd
        kp = np.full(joints, ACCELERATION_KP) if kp is None else kp
        return kp, 2.0 * np.sqrt(kp) if kd is None else kd


def _of_joints(values: tuple[float, ...] | None, joints: int, where: str) -> Array | None:
    if values is None:
        return None
    if len(values) not in (1, joints):
        raise InvalidInputError(
            f"{where} has {len(values)} numbers; give one, or one for each of the {joints} joints"
        )
    return np.resize(np.array(values), joints)
