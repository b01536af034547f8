from .checker import (
    STILL as STILL,
    ArmCollision as ArmCollision,
    Overlap as Overlap,
)
from .edge_checker import EdgeChecker as EdgeChecker
from .home_posture import (
    HomeClearance as HomeClearance,
    home_clearance as home_clearance,
    require_free_home as require_free_home,
)
