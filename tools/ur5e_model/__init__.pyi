from .__main__ import model_texts as model_texts
from .collision import (
    BASE_SHAPES as BASE_SHAPES,
    LINK_SHAPES as LINK_SHAPES,
    NEVER_MEET as NEVER_MEET,
)
from .figures import (
    ACCELERATION as ACCELERATION,
    BASE as BASE,
    BASE_INERTIA as BASE_INERTIA,
    FLANGE as FLANGE,
    JOINTS as JOINTS,
    LINK_INERTIAS as LINK_INERTIAS,
    ROTOR_INERTIA as ROTOR_INERTIA,
    VELOCITY as VELOCITY,
    Joint as Joint,
    dh_origin as dh_origin,
)
from .urdf import arm_urdf as arm_urdf
