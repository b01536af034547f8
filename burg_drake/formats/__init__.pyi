from .burg_grasps import BURG_TOOLKIT_FORMAT as BURG_TOOLKIT_FORMAT
from .burg_toolkit import (
    BurgInstance as BurgInstance,
    BurgLibrary as BurgLibrary,
    BurgMarkers as BurgMarkers,
    BurgObject as BurgObject,
    BurgPrintout as BurgPrintout,
    BurgScene as BurgScene,
    locate_file as locate_file,
    read_burg_library as read_burg_library,
    read_burg_scene as read_burg_scene,
)
from .grasp_conversion import (
    GRASP_SUCCESS_COLUMN as GRASP_SUCCESS_COLUMN,
    LABELLED_BY as LABELLED_BY,
    check_gripper_name as check_gripper_name,
    object_description as object_description,
    object_name as object_name,
    success_labels as success_labels,
    with_objects_renamed as with_objects_renamed,
    with_success as with_success,
    write_each_object as write_each_object,
)
from .grasp_files import (
    BURG_DRAKE_FORMAT as BURG_DRAKE_FORMAT,
    GRASP_FORMATS as GRASP_FORMATS,
    format_by_suffix as format_by_suffix,
    format_named as format_named,
    format_of as format_of,
    read_grasp_file as read_grasp_file,
    write_grasp_file as write_grasp_file,
)
from .grasp_format import (
    PANDA_GRIPPER as PANDA_GRIPPER,
    PREGRASP_WIDTH_COLUMN as PREGRASP_WIDTH_COLUMN,
    GraspFormat as GraspFormat,
    Gripper as Gripper,
    GripperJoint as GripperJoint,
    ImportedGrasps as ImportedGrasps,
    PoseFrame as PoseFrame,
    axis_along as axis_along,
    convention_of as convention_of,
    group_by_convention as group_by_convention,
    origin_in_words as origin_in_words,
)
from .graspnet import GRASPNET_FORMAT as GRASPNET_FORMAT, graspnet_X_FG as graspnet_X_FG
from .isaac_grasp import (
    GRASPGEN_YAML_FORMAT as GRASPGEN_YAML_FORMAT,
    ISAAC_GRASP_FORMAT as ISAAC_GRASP_FORMAT,
)
from .pose_files import nearest_rigid as nearest_rigid, read_poses as read_poses
from .vgn import VGN_FORMAT as VGN_FORMAT
from .ycb import (
    YCB_MASS_SOURCE as YCB_MASS_SOURCE,
    YCB_MASSES as YCB_MASSES,
    YCB_NAMES as YCB_NAMES,
    YcbObject as YcbObject,
    find_ycb as find_ycb,
    find_ycb_name as find_ycb_name,
)
