"""Published figures of the Franka Emika Panda arm and hand: the only place that holds numbers.

Sources:
    [FCI]    Franka Control Interface documentation, "Robot and interface specifications"
             (https://frankaemika.github.io/docs/control_parameters.html): kinematics in Craig's
             convention and joint limits.
    [GAZ]    Gaz, Cognetti, Oliva, Robuffo Giordano, De Luca: "Dynamic Identification of the Franka
             Emika Panda Robot With Retrieval of Feasible Parameters Using Penalty-Based
             Optimization", RA-L 4(4), 2019; as tabulated in franka_ros
             (franka_description/robots/common/inertial.yaml).
    [FROS]   franka_ros, franka_description/robots/common/franka_hand.xacro: hand and fingers.
    [FR3]    reflected rotor inertias that Franka gives for the FR3, as tabulated in
             drake/manipulation/models/franka_description/README.md; none is published for the
             Panda, whose drives are of the same size.
    [DATA]   Panda and Franka Hand data sheets: forces and speeds of the hand.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from tools.robot_model.inertia import Inertia


@dataclass(frozen=True)
class Joint:
    """One revolute joint of the arm.

    Attributes:
        a, d, alpha: Craig's DH parameters a_(i-1) [m], d_i [m], alpha_(i-1) [rad] [FCI].
        lower, upper: position limits [rad] [FCI].
        velocity: limit [rad/s] [FCI].
        acceleration: limit [rad/s^2] [FCI].
        effort: torque limit [Nm] [FCI].
        rotor_inertia: inertia of rotor and gear, seen at the joint [kg m^2] [FR3].
    """

    a: float
    d: float
    alpha: float
    lower: float
    upper: float
    velocity: float
    acceleration: float
    effort: float
    rotor_inertia: float


JOINTS: tuple[Joint, ...] = (
    Joint(0.0, 0.333, 0.0, -2.8973, 2.8973, 2.175, 15.0, 87.0, 0.605721456),
    Joint(0.0, 0.0, -pi / 2, -1.7628, 1.7628, 2.175, 7.5, 87.0, 0.605721456),
    Joint(0.0, 0.316, pi / 2, -2.8973, 2.8973, 2.175, 10.0, 87.0, 0.462474144),
    Joint(0.0825, 0.0, pi / 2, -3.0718, -0.0698, 2.175, 12.5, 87.0, 0.462474144),
    Joint(-0.0825, 0.384, -pi / 2, -2.8973, 2.8973, 2.61, 15.0, 12.0, 0.205544064),
    Joint(0.0, 0.0, pi / 2, -0.0175, 3.7525, 2.61, 20.0, 12.0, 0.205544064),
    Joint(0.088, 0.0, pi / 2, -2.8973, 2.8973, 2.61, 20.0, 12.0, 0.205544064),
)
"""Joints 1 to 7 of the arm."""

FLANGE_OFFSET = 0.107
"""Flange frame along z of link 7 [m] [FCI]."""

HOME = (0.0, -pi / 4, 0.0, -3 * pi / 4, 0.0, pi / 2, pi / 4)
"""Usual ready posture of the arm [rad]."""


LINK_INERTIAS: tuple[Inertia, ...] = (
    Inertia(
        0.629769,
        (-0.041018, -0.00014, 0.049974),
        (0.00315, 0.00388, 0.004285),
        (8.2904e-07, 0.00015, 8.2299e-06),
    ),
    Inertia(
        4.970684,
        (0.003875, 0.002081, -0.04762),
        (0.70337, 0.70661, 0.009117),
        (-0.000139, 0.006772, 0.019169),
    ),
    Inertia(
        0.646926,
        (-0.003141, -0.02872, 0.003495),
        (0.007962, 0.02811, 0.025995),
        (-0.003925, 0.010254, 0.000704),
    ),
    Inertia(
        3.228604,
        (0.027518, 0.039252, -0.066502),
        (0.037242, 0.036155, 0.01083),
        (-0.004761, -0.011396, -0.012805),
    ),
    Inertia(
        3.587895,
        (-0.05317, 0.104419, 0.027454),
        (0.025853, 0.019552, 0.028323),
        (0.007796, -0.001332, 0.008641),
    ),
    Inertia(
        1.225946,
        (-0.011953, 0.041065, -0.038437),
        (0.035549, 0.029474, 0.008627),
        (-0.002117, -0.004037, 0.000229),
    ),
    Inertia(
        1.666555,
        (0.060149, -0.014117, -0.010517),
        (0.001964, 0.004354, 0.005433),
        (0.000109, -0.001158, 0.000341),
    ),
    Inertia(
        0.735522,
        (0.010517, -0.004252, 0.061597),
        (0.012516, 0.010027, 0.004815),
        (-0.000428, -0.001196, -0.000741),
    ),
)
"""Links 0 to 7 [GAZ]. Ixx and Iyy of link 1 are large because joint 1 turns it about z only, so
that the identification does not see them: they play no part while the base stands still."""

HAND_INERTIA = Inertia(0.73, (-0.01, 0.0, 0.03), (0.001, 0.0025, 0.0017))
"""Hand without fingers [FROS]."""

FINGER_MASS = 0.015
"""One finger [kg] [FROS]; its inertia follows from its boxes at uniform density."""

FINGER_JOINT_HEIGHT = 0.0584
"""Origin of both fingers along z of the hand [m] [FROS]."""
FINGER_TRAVEL = 0.04
"""Travel of each finger from the closed position [m] [FROS]."""
FINGER_EFFORT = 70.0
"""Continuous force of each finger [N] [DATA]."""
FINGER_SPEED = 0.05
"""Speed of each finger [m/s] [DATA]."""
TCP_HEIGHT = 0.1034
"""Tool centre point along z of the hand [m] [FROS]."""
GRASP_FORCE = 40.0
"""Default force of each finger while gripping [N]: within the continuous rating."""


def dh_pose(joint: Joint) -> np.ndarray:
    """X_PJ (4, 4): the joint's frame at position 0 in the frame of the link before (Craig)."""
    c, s = np.cos(joint.alpha), np.sin(joint.alpha)
    X_PJ = np.eye(4)
    X_PJ[:3, :3] = [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]
    X_PJ[:3, 3] = [joint.a, -s * joint.d, c * joint.d]
    return X_PJ
