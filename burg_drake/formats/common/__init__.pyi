from .convention import (
    convention_of as convention_of,
    grouped as grouped,
)
from .conversion import (
    with_objects_renamed as with_objects_renamed,
    with_success as with_success,
    write_each_object as write_each_object,
)
from .grasp_format import (
    PANDA as PANDA,
    PREGRASP_WIDTH as PREGRASP_WIDTH,
    GraspFormat as GraspFormat,
    Gripper as Gripper,
    GripperJoint as GripperJoint,
    ImportedGrasps as ImportedGrasps,
    PoseFrame as PoseFrame,
)
from .losses import conversion_losses as conversion_losses
from .one_object import (
    HANDS as HANDS,
    SUCCESS_COLUMN as SUCCESS_COLUMN,
    check_hand as check_hand,
    object_name as object_name,
    only_object as only_object,
    scale_note as scale_note,
    shareable_description as shareable_description,
    success_of as success_of,
)
from .pose_file import read_poses as read_poses
from .rigid import nearest_rigid as nearest_rigid
