from .arm_control import ArmControl as ArmControl
from .board_visibility import (
    frustum as frustum,
    seen_share as seen_share,
)
from .boxes import boxes_in_scene as boxes_in_scene
from .content import world_content as world_content
from .engine import (
    DEFAULT_ENGINE as DEFAULT_ENGINE,
    DRAKE_ENGINES as DRAKE_ENGINES,
    ENGINES as ENGINES,
    Engine as Engine,
    as_drake_engine as as_drake_engine,
    as_engine as as_engine,
)
from .grasp_motion import GraspMotion as GraspMotion
from .gripper_document import (
    Finger as Finger,
    Hand as Hand,
    load_hand as load_hand,
    locate_hand as locate_hand,
)
from .station_document import (
    FOCAL_RANGE as FOCAL_RANGE,
    HALF_PIXEL as HALF_PIXEL,
    MAX_SIDE as MAX_SIDE,
    MODEL_NAMES as MODEL_NAMES,
    Arm as Arm,
    Camera as Camera,
    Obstacle as Obstacle,
    Station as Station,
    StationDocument as StationDocument,
    StationLike as StationLike,
    Table as Table,
    as_station as as_station,
    load_station as load_station,
    require_image_size as require_image_size,
)
