from .board_visual import (
    board_meshes as board_meshes,
    marker_grid as marker_grid,
)
from .camera_sensors import (
    LIGHTS as LIGHTS,
    RENDERER as RENDERER,
    add_cameras as add_cameras,
    add_renderer as add_renderer,
)
from .contact_parts import (
    ContactParts as ContactParts,
    add_contact_parts as add_contact_parts,
    is_on_table as is_on_table,
    needs_no_pieces as needs_no_pieces,
)
from .gripper import (
    gripper_of as gripper_of,
    station_gripper as station_gripper,
)
from .hand_check import (
    HandFigures as HandFigures,
    check_hand as check_hand,
)
from .hand_model import (
    STALL as STALL,
    add_hand as add_hand,
    find_hand as find_hand,
)
from .instances import (
    PLACE as PLACE,
    RISE as RISE,
    add_instance as add_instance,
    add_vertical_joint as add_vertical_joint,
    name_taken_error as name_taken_error,
)
from .mesh_pieces import is_mesh as is_mesh
from .model_file import (
    add_models as add_models,
    buffered_remarks as buffered_remarks,
    set_packages as set_packages,
)
from .robot import (
    ROBOT_MODELS as ROBOT_MODELS,
    Robot as Robot,
    add_robot as add_robot,
    inverse_dynamics as inverse_dynamics,
    joint_actuators as joint_actuators,
    set_default_posture as set_default_posture,
)
from .rolling import (
    ROLLING as ROLLING,
    is_ball as is_ball,
)
from .standing import add_standing as add_standing
from .surroundings import (
    DISSIPATION as DISSIPATION,
    OBSTACLE_COLOR as OBSTACLE_COLOR,
    TABLE_COLOR as TABLE_COLOR,
    TABLE_MODULUS as TABLE_MODULUS,
    FixedBox as FixedBox,
    add_board as add_board,
    add_obstacles as add_obstacles,
    add_table as add_table,
    obstacle_boxes as obstacle_boxes,
    obstacle_name_error as obstacle_name_error,
    table_box as table_box,
)
