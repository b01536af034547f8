from .clearance_bounds import (
    LIKELY as LIKELY,
    ArmProximity as ArmProximity,
    ClearanceBounds as ClearanceBounds,
)
