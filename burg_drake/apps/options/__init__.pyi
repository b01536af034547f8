from .arguments import (
    DEFAULT_STATION as DEFAULT_STATION,
    Parser as Parser,
    VerbGroup as VerbGroup,
    add_group as add_group,
    add_measured_board as add_measured_board,
    add_only as add_only,
    add_quiet as add_quiet,
    add_renaming as add_renaming,
    add_scene as add_scene,
    add_station as add_station,
    add_verb as add_verb,
    add_workers as add_workers,
    examples as examples,
    print_scale as print_scale,
    scene_names as scene_names,
)
from .camera import (
    add_depth_unit as add_depth_unit,
    add_intrinsics as add_intrinsics,
    add_live_camera as add_live_camera,
    chosen_intrinsics as chosen_intrinsics,
)
from .cluster import (
    add_cluster as add_cluster,
    chosen_cluster as chosen_cluster,
)
from .declared import (
    add_options as add_options,
    settings_from as settings_from,
)
from .given_grasps import (
    add_given as add_given,
    read_given as read_given,
    require_file as require_file,
)
from .grasp_file import (
    FRAMES as FRAMES,
    add_camera_options as add_camera_options,
    add_file_options as add_file_options,
    add_file_station as add_file_station,
    add_hand as add_hand,
    gripper_for as gripper_for,
    named_gripper as named_gripper,
    station_for as station_for,
)
from .grasp_output import (
    Output as Output,
    add_format as add_format,
    named as named,
    output_of as output_of,
    print_notes as print_notes,
)
from .hand_motion import (
    add_motion as add_motion,
    chosen_motion as chosen_motion,
    given_motion as given_motion,
    motion_option as motion_option,
    require_standoff_of_arm as require_standoff_of_arm,
)
from .pages import (
    add_page as add_page,
    add_view as add_view,
)
from .retries import (
    add_retry_failed as add_retry_failed,
    how_to_retry as how_to_retry,
)
from .sampling import (
    add_sampling as add_sampling,
    grasps_per_object as grasps_per_object,
    print_shortfalls as print_shortfalls,
    require_sampled as require_sampled,
)
from .values import (
    coefficient as coefficient,
    friction as friction,
    input_file as input_file,
    named_positive as named_positive,
    names as names,
    not_negative as not_negative,
    number as number,
    positive as positive,
    positive_int as positive_int,
    seed as seed,
    two_numbers as two_numbers,
    unit as unit,
    with_given_names as with_given_names,
)
