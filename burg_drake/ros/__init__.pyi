from .board_node import BoardNode as BoardNode, Sighting as Sighting
from .camera_messages import (
    IMAGE_ENCODINGS as IMAGE_ENCODINGS,
    decode_image_message as decode_image_message,
    intrinsics_from_camera_info as intrinsics_from_camera_info,
)
from .distribution import (
    CLIENT_LIBRARIES as CLIENT_LIBRARIES,
    ROS_1_HINT as ROS_1_HINT,
    ROS_2_HINT as ROS_2_HINT,
    SYSTEM_PACKAGES as SYSTEM_PACKAGES,
    choose_distribution as choose_distribution,
    start_ros_node as start_ros_node,
)
from .loop import (
    StatusLog as StatusLog,
    StatusLogIntervals as StatusLogIntervals,
    run_node as run_node,
)
from .ros_node import (
    MessageClasses as MessageClasses,
    NodeNames as NodeNames,
    ParentFrame as ParentFrame,
    Publications as Publications,
    camera_pose_message as camera_pose_message,
    compressed_message as compressed_message,
    image_message as image_message,
    status_message as status_message,
    transform_message as transform_message,
)
