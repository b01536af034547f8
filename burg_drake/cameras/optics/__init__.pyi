from .field_of_view import (
    NEAR as NEAR,
    FieldOfView as FieldOfView,
)
from .fisheye import fisheye_lens as fisheye_lens
from .intrinsics import (
    HALF_PIXEL as HALF_PIXEL,
    Intrinsics as Intrinsics,
    LensModel as LensModel,
    camera_info as camera_info,
    of_camera as of_camera,
)
from .intrinsics_file import (
    ROS_FISHEYE as ROS_FISHEYE,
    ROS_MODELS as ROS_MODELS,
    is_ros_fisheye as is_ros_fisheye,
    load_intrinsics as load_intrinsics,
    save_camera_info as save_camera_info,
    save_intrinsics as save_intrinsics,
)
from .known_parts import (
    LARGEST as LARGEST,
    PARTS as PARTS,
    is_local as is_local,
    known_words as known_words,
)
from .sensors import (
    SENSORS as SENSORS,
    sensor as sensor,
)
from .station_camera import (
    DEFAULT_CAMERA as DEFAULT_CAMERA,
    SIMULATED as SIMULATED,
    simulated_camera as simulated_camera,
)
from .undistortion import Undistortion as Undistortion
