"""Published figures of the arm UR5e of Universal Robots: the only place that holds numbers.

Sources:
    [DH]     Universal Robots, "DH Parameters for calculations of kinematics and dynamics"
             (https://www.universal-robots.com/articles/ur/application-installation/
             dh-parameters-for-calculations-of-kinematics-and-dynamics/): kinematics, masses and
             centres of mass.
    [DESC]   Universal_Robots_ROS2_Description, config/ur5e/joint_limits.yaml and
             physical_parameters.yaml (BSD-3, see models/ur5e/LICENSE): limits, which it takes from
             the UR5e User Manual 5.8 and the article "Max. joint torques"; inertia tensors.
    [MJ]     MuJoCo Menagerie, universal_robots_ur5e/ur5e.xml (BSD-3).

Not verified: the mass of the base, which [DESC] itself calls doubtful and which plays no part as
the base stands still; accelerations and rotor inertias, which Universal Robots does not publish.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from tools.robot_model.inertia import Inertia


@dataclass(frozen=True)
class Joint:
    """One revolute joint, with the link that it moves.

    The table [DH] is in the standard convention, where a row holds d and theta of a joint, and a
    and alpha of the link after it. Here a and alpha are those of the row before, which makes them
    Craig's, with link frames whose z axes are the joints' own.

    Attributes:
        name, link: as in the manufacturer's own URDF.
        a, d, alpha: Craig's a_(i-1) [m], d_i [m], alpha_(i-1) [rad] [DH].
        lower, upper: position limits [rad] [DESC].
        effort: torque limit [Nm] [DESC].
    """

    name: str
    link: str
    a: float
    d: float
    alpha: float
    lower: float
    upper: float
    effort: float


JOINTS: tuple[Joint, ...] = (
    Joint("shoulder_pan_joint", "shoulder_link", 0.0, 0.1625, 0.0, -2 * pi, 2 * pi, 150.0),
    Joint("shoulder_lift_joint", "upper_arm_link", 0.0, 0.0, pi / 2, -2 * pi, 2 * pi, 150.0),
    # The controller allows a whole turn either way, too, but the upper arm is in the way.
    Joint("elbow_joint", "forearm_link", -0.425, 0.0, 0.0, -pi, pi, 150.0),
    Joint("wrist_1_joint", "wrist_1_link", -0.3922, 0.1333, 0.0, -2 * pi, 2 * pi, 28.0),
    Joint("wrist_2_joint", "wrist_2_link", 0.0, 0.0997, pi / 2, -2 * pi, 2 * pi, 28.0),
    Joint("wrist_3_joint", "wrist_3_link", 0.0, 0.0996, -pi / 2, -2 * pi, 2 * pi, 28.0),
)
"""Joints from base to flange."""

BASE = "base"
"""The first link. Its frame is that of the controller: at all zeros the arm lies along -x."""
FLANGE = "flange"
"""Frame on the tool flange, z outwards; that of the controller's last DH row."""

VELOCITY = pi
"""Of every joint [rad/s] [DESC]."""
ACCELERATION = pi
"""Of every joint [rad/s^2]: what [DESC] sets for planners and calls not publicly available."""
ROTOR_INERTIA = 0.1
"""Inertia of rotor and gear of every joint, seen at the joint [kg m^2]: the armature of [MJ], whose
authors call it not carefully tuned."""

BASE_INERTIA = Inertia(4.0, (0.0, 0.0, 0.0), (0.00443333, 0.00443333, 0.0072))
"""[DESC] Its mass is said to be possibly wrong."""


def _dh_inertia(
    mass: float,
    p_cm: tuple[float, float, float],
    moments: tuple[float, float, float],
    products: tuple[float, float, float],
    a: float = 0.0,
    alpha: float = 0.0,
) -> Inertia:
    """Mass properties in the link's frame.

    Args:
        mass: [kg] [DH].
        p_cm: centre of mass in the DH frame at the link's far end [m] [DH].
        moments, products: about the centre of mass, axes of that frame [kg m^2] [DESC].
        a, alpha: of the link's own row: the far end's frame is at a along x, turned by alpha about
            x.
    """
    c, s = round(np.cos(alpha)), round(np.sin(alpha))  # quarter turns
    R = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    x, y, z = (float(v) for v in R @ p_cm)
    tensor = np.diag(moments)
    for (i, j), value in zip(((0, 1), (0, 2), (1, 2)), products, strict=True):
        tensor[i, j] = tensor[j, i] = value
    tensor = R @ tensor @ R.T
    xx, yy, zz = (float(v) for v in np.diag(tensor))
    xy, xz, yz = (float(tensor[i, j]) for i, j in ((0, 1), (0, 2), (1, 2)))
    return Inertia(mass, (round(a + x, 12), y, z), (xx, yy, zz), (xy, xz, yz))


LINK_INERTIAS: tuple[Inertia, ...] = (
    _dh_inertia(
        3.761,
        (0.0, -0.02561, 0.00193),
        (0.00700210, 0.00648091, 0.00657286),
        (0.00000073, -0.00001053, 0.00049994),
        alpha=pi / 2,
    ),
    _dh_inertia(
        8.058,
        (0.2125, 0.0, 0.11336),
        (0.01505885, 0.33388086, 0.33247207),
        (-0.00005400, 0.00000563, -0.00000181),
        a=-0.425,
    ),
    _dh_inertia(
        2.846,
        (0.15, 0.0, 0.0265),
        (0.00399632, 0.07879254, 0.07848510),
        (-0.00001365, 0.00137272, -0.00000660),
        a=-0.3922,
    ),
    _dh_inertia(
        1.37,
        (0.0, -0.0018, 0.01634),
        (0.00165491, 0.00135962, 0.00126279),
        (-0.00000282, -0.00000438, 0.00010157),
        alpha=pi / 2,
    ),
    _dh_inertia(
        1.3,
        (0.0, 0.0018, 0.01634),
        (0.00135617, 0.00127827, 0.00096614),
        (-0.00000274, 0.00000444, -0.00005048),
        alpha=-pi / 2,
    ),
    _dh_inertia(
        0.365,
        (0.0, 0.0, -0.001159),
        (0.00018694, 0.00018908, 0.00025756),
        (0.00000006, -0.00000017, -0.00000092),
    ),
)
"""Of the links that the joints move."""


def dh_origin(joint: Joint) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Translation [m] and roll-pitch-yaw [rad] of a joint at position 0 in the link before."""
    c, s = round(np.cos(joint.alpha)), round(np.sin(joint.alpha))  # quarter turns
    return (joint.a, -s * joint.d, c * joint.d), (joint.alpha, 0.0, 0.0)
