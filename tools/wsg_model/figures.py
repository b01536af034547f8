"""Published figures of the Schunk (Weiss Robotics) WSG 50-110: the only place that holds numbers.

Sources:
    [DATA]   Data sheet of the WSG 50-110: body 146 x 50 x 72.5 mm, stroke 110 mm, gripping force 5
             to 80 N, speed 5 to 420 mm/s, 1.2 kg.
    [CMD]    WSG command set reference manual: speeds are those of the fingers relative to each
             other, and the gripping force is twice the force of one finger on the part.
    [ROS]    wsg50-ros-pkg (BSD-3) and schunk_wsg_50.sdf of Drake, which is based on it: base jaws
             of 23 mm, base jaw and standard finger together 83 mm long and 16 mm thick, fingers
             20 mm broad, 0.1 kg each.

The pads are this project's: flat strips of rubber on the ends of the standard fingers, which are of
bare metal in the data sheet. The frame H has its origin in the middle of the mounting face, x along
the stroke, z towards the fingers; the frame of a finger has its origin in the front face.
"""

from __future__ import annotations

import numpy as np

from tools.robot_model.inertia import Inertia

BODY = (0.146, 0.050, 0.0725)
"""Extents of the body along x, y, z of H [m] [DATA]."""
ADAPTER = (0.063, 0.010)
"""Diameter and height of the plate between flange and gripper [m]; the diameter is that of a flange
after ISO 9409-1-50-4-M6."""
MASS = 1.2
"""Mass of the gripper with its fingers [kg] [DATA]."""
FINGER_MASS = 0.1
"""One base jaw with its finger [kg] [ROS]."""

FINGER_TRAVEL = 0.055
"""Travel of each finger from the closed position: half of the stroke [m] [DATA]."""
FINGER_EFFORT = 40.0
"""Largest force of each finger [N]: half of the gripping force [DATA, CMD]."""
FINGER_SPEED = 0.21
"""Largest speed of each finger in H [m/s]: half of the relative one [DATA, CMD]."""

JAW_HEIGHT = 0.023
"""Base jaws along z, from the front face [m] [ROS]."""
FINGER_HEIGHT = 0.083
"""Finger tips along z, from the front face [m] [ROS]."""
FINGER_THICKNESS = 0.016
"""Finger along x, pad included [m] [ROS]."""
FINGER_BREADTH = 0.020
"""Finger and pad along y [m] [ROS]."""
PAD_THICKNESS = 0.008
PAD_HEIGHT = 0.020
"""Pad along x and z [m]."""
PAD_CENTER = FINGER_HEIGHT - PAD_HEIGHT / 2
"""Middle of the pad along z, from the front face [m]; the pad ends with the finger."""
TCP_HEIGHT = round(BODY[2] + PAD_CENTER, 6)
"""Grasp frame along z of H [m]."""

GRASP_FORCE = 30.0
"""Default force of each finger while gripping [N]."""
CLOSING_SPEED = 0.05
"""Default speed of each finger while closing [m/s]."""


def body_inertia() -> Inertia:
    """The gripper without its fingers, as a box of one density."""
    mass = MASS - 2 * FINGER_MASS
    x, y, z = (float(v) for v in np.square(BODY))
    moments = (mass / 12 * (y + z), mass / 12 * (x + z), mass / 12 * (x + y))
    return Inertia(mass, (0.0, 0.0, BODY[2] / 2), moments)
