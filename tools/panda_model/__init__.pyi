from .base_look import base_parts as base_parts
from .collision import (
    ARM_SHAPES as ARM_SHAPES,
    HAND_SHAPES as HAND_SHAPES,
    LEFT_FINGER_SHAPES as LEFT_FINGER_SHAPES,
)
from .figures import (
    FINGER_EFFORT as FINGER_EFFORT,
    FINGER_JOINT_HEIGHT as FINGER_JOINT_HEIGHT,
    FINGER_MASS as FINGER_MASS,
    FINGER_SPEED as FINGER_SPEED,
    FINGER_TRAVEL as FINGER_TRAVEL,
    FLANGE_OFFSET as FLANGE_OFFSET,
    GRASP_FORCE as GRASP_FORCE,
    HAND_INERTIA as HAND_INERTIA,
    JOINTS as JOINTS,
    LINK_INERTIAS as LINK_INERTIAS,
    TCP_HEIGHT as TCP_HEIGHT,
    Joint as Joint,
    dh_pose as dh_pose,
)
from .hand_document import hand_yaml as hand_yaml
from .hand_look import finger_parts as finger_parts, hand_parts as hand_parts
from .limb_look import (
    CELL as CELL,
    RADIUS as RADIUS,
    SEAM as SEAM,
    elbow_parts as elbow_parts,
    shoulder_parts as shoulder_parts,
)
from .looks import link_parts as link_parts
from .sdf import arm_sdf as arm_sdf, hand_sdf as hand_sdf
from .wrist_look import (
    flange_parts as flange_parts,
    forearm_parts as forearm_parts,
    wrist_parts as wrist_parts,
)
