from .camera_sensors import (
    DEFAULT_LIGHTS as DEFAULT_LIGHTS,
    RENDERER_NAME as RENDERER_NAME,
    add_renderer as add_renderer,
    render_cameras as render_cameras,
    supersampled_camera as supersampled_camera,
)
from .collision_world import CollisionWorld as CollisionWorld, PosedShapes as PosedShapes
from .contact_parts import ContactParts as ContactParts, is_on_table as is_on_table
from .diagram_builder import build_station_diagram as build_station_diagram
from .engine import (
    DEFAULT_ENGINE as DEFAULT_ENGINE,
    DRAKE_ENGINES as DRAKE_ENGINES,
    ENGINES as ENGINES,
    Engine as Engine,
    as_drake_engine as as_drake_engine,
    as_engine as as_engine,
)
from .grasp_motion import GraspMotion as GraspMotion
from .hand_description import (
    FingerLink as FingerLink,
    HandDescription as HandDescription,
    HandLink as HandLink,
    HandShape as HandShape,
    PadFront as PadFront,
    read_hand as read_hand,
)
from .hand_document import (
    Finger as Finger,
    Hand as Hand,
    load_hand as load_hand,
    locate_hand as locate_hand,
)
from .hand_model import (
    STALL_FORCE_RATIO as STALL_FORCE_RATIO,
    HandFigures as HandFigures,
    add_hand as add_hand,
    check_hand as check_hand,
    gripper_of as gripper_of,
    station_gripper as station_gripper,
)
from .model_file import (
    add_models as add_models,
    buffer_drake_log as buffer_drake_log,
    require_valid_numbers as require_valid_numbers,
)
from .object_bodies import (
    PLACEMENT_FRAME_NAME as PLACEMENT_FRAME_NAME,
    VERTICAL_JOINT_NAME as VERTICAL_JOINT_NAME,
)
from .object_contact import (
    assign_contact as assign_contact,
    collision_geometries as collision_geometries,
    filter_contact_pairs as filter_contact_pairs,
    make_compliant as make_compliant,
    replace_meshes_by_pieces as replace_meshes_by_pieces,
    touching_bodies as touching_bodies,
)
from .ports import make_controller_plant as make_controller_plant
from .robot import (
    ROBOT_MODELS as ROBOT_MODELS,
    Robot as Robot,
    add_robot as add_robot,
    joint_actuators as joint_actuators,
)
from .scene_check import (
    MAX_SINK_DEPTH as MAX_SINK_DEPTH,
    SceneCheck as SceneCheck,
    check_scene as check_scene,
    find_overlaps as find_overlaps,
    surface_issues as surface_issues,
)
from .station_diagram import (
    FloatingHand as FloatingHand,
    HandHandle as HandHandle,
    MountedHand as MountedHand,
    StationDiagram as StationDiagram,
    instance_pose as instance_pose,
)
from .station_document import (
    DEFAULT_ACCELERATION_GAIN as DEFAULT_ACCELERATION_GAIN,
    DEFAULT_JOINT_STIFFNESS as DEFAULT_JOINT_STIFFNESS,
    FOCAL_RANGE as FOCAL_RANGE,
    HALF_PIXEL as HALF_PIXEL,
    MAX_IMAGE_SIDE as MAX_IMAGE_SIDE,
    MODEL_NAMES as MODEL_NAMES,
    Arm as Arm,
    ArmControl as ArmControl,
    Camera as Camera,
    Obstacle as Obstacle,
    Station as Station,
    StationDocument as StationDocument,
    StationLike as StationLike,
    Table as Table,
    are_points_in_view as are_points_in_view,
    as_station as as_station,
    board_points as board_points,
    frustum as frustum,
    lines_through_box as lines_through_box,
    load_station as load_station,
    obstacle_corners as obstacle_corners,
    require_image_size as require_image_size,
    visible_board_share as visible_board_share,
)
from .surroundings import (
    FixedBox as FixedBox,
    SurroundingsProperties as SurroundingsProperties,
    board_meshes as board_meshes,
    marker_grid as marker_grid,
    obstacle_boxes as obstacle_boxes,
    table_box as table_box,
)
from .valid_scene import require_valid_scene as require_valid_scene, world_content as world_content
from .visible_triangles import (
    Triangles as Triangles,
    hull_vertices as hull_vertices,
    shape_triangles as shape_triangles,
    visible_surfaces as visible_surfaces,
)
