from .board_edge import BoardEdgeGuard as BoardEdgeGuard
from .landing import drop_onto_scene as drop_onto_scene
from .reduced_friction import reduce_friction_of as reduce_friction_of
from .resting_poses import confirm_poses as confirm_poses
from .scene_state import placed_scene as placed_scene
from .settled_scene import (
    SettledScene as SettledScene,
    settle_scene as settle_scene,
)
from .settling_defaults import (
    SETTLING_ENGINE as SETTLING_ENGINE,
    SETTLING_TIME as SETTLING_TIME,
)
