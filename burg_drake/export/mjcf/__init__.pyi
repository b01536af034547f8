from .hand import (
    BACK as BACK,
    CARRIER as CARRIER,
    SHAPE as SHAPE,
    SPHERE as SPHERE,
    link_name as link_name,
    pad_contact as pad_contact,
)
from .trial_model import (
    FIXED as FIXED,
    LIFT as LIFT,
    OBJECT as OBJECT,
    TABLE as TABLE,
    trial_mjcf as trial_mjcf,
)
