from .cli import build_parser as build_parser, main as main
from .commands.camera import field_of_view as field_of_view, print_intrinsics as print_intrinsics
from .commands.camera_placement import placement_table as placement_table
from .commands.doctor import FeatureCheck as FeatureCheck
from .commands.grasp_sampling import sampling_table as sampling_table
from .commands.grasp_tables import (
    comparison_table as comparison_table,
    number_table as number_table,
    ranking_table as ranking_table,
    summary_table as summary_table,
)
from .commands.library import library_table as library_table
from .commands.reach import (
    outcome_table as outcome_table,
    print_reach_tables as print_reach_tables,
    reach_table as reach_table,
)
from .commands.scene import displacement_table as displacement_table
from .commands.trial_page import _load_or_create_secret as _load_or_create_secret
from .lab_page_server import LAB_PAGE_FILES as LAB_PAGE_FILES, LabServer as LabServer
from .live_view import LIVE_VIEW_FILES as LIVE_VIEW_FILES, ViewServer as ViewServer
from .options.arguments import (
    DEFAULT_STATION as DEFAULT_STATION,
    MAX_PAGE_CONNECTIONS as MAX_PAGE_CONNECTIONS,
    Parser as Parser,
    retry_advice as retry_advice,
)
from .options.evaluated_grasps import (
    add_motion_options as add_motion_options,
    describe_motion_remedy as describe_motion_remedy,
    motion_from_options as motion_from_options,
    read_grasps_from_options as read_grasps_from_options,
)
from .options.grasp_files import (
    DEFAULT_HAND as DEFAULT_HAND,
    grasp_output as grasp_output,
    gripper_by_name as gripper_by_name,
    load_grasp_source as load_grasp_source,
    open_grasp_source as open_grasp_source,
)
from .options.settings_options import (
    add_settings_options as add_settings_options,
    settings_from as settings_from,
)
from .page_server import MAX_REFUSALS as MAX_REFUSALS
from .terminal import (
    print_legend as print_legend,
    sigterm_as_interrupt as sigterm_as_interrupt,
    tick_line as tick_line,
)
