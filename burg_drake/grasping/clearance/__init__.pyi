from .collision_geometry import (
    hand_against as hand_against,
    read_shapes as read_shapes,
    screened_bodies as screened_bodies,
    shape_of as shape_of,
)
from .hand_clearance import (
    ClearanceMode as ClearanceMode,
    HandClearance as HandClearance,
    hand_clearance_alone as hand_clearance_alone,
)
from .verdict import (
    CLEARANCE_VERSION as CLEARANCE_VERSION,
    Clearance as Clearance,
    ClearanceBatch as ClearanceBatch,
)
