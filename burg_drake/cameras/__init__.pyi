from .board_loop import (
    BoardLoop as BoardLoop,
    LoopCamera as LoopCamera,
    build_board_loop as build_board_loop,
)
from .calibration.charuco_target import (
    CharucoTarget as CharucoTarget,
    CharucoView as CharucoView,
    find_target as find_target,
)
from .calibration.estimation import (
    CalibratedView as CalibratedView,
    Calibration as Calibration,
    calibrate as calibrate,
    calibrate_views as calibrate_views,
    corner_displacement as corner_displacement,
)
from .calibration.lens_fit import fit_lens as fit_lens, guess_camera as guess_camera
from .calibration.lens_uncertainty import (
    BOUND_SIGMAS as BOUND_SIGMAS,
    COVERAGE_GRID as COVERAGE_GRID,
    CalibrationAccuracy as CalibrationAccuracy,
    LensHypothesis as LensHypothesis,
    Promise as Promise,
    calibration_accuracy as calibration_accuracy,
    camera_covariance as camera_covariance,
    camera_error as camera_error,
    corner_coverage as corner_coverage,
    image_grid as image_grid,
    image_part_indices as image_part_indices,
)
from .calibration.target_sheet import target_origin as target_origin, write_target as write_target
from .calibration.view_guidance import (
    ViewCollector as ViewCollector,
    calibration_advice as calibration_advice,
    is_useless as is_useless,
    wanted_views as wanted_views,
)
from .depth_camera_noise import (
    depth_edges as depth_edges,
    hidden_from_second_imager as hidden_from_second_imager,
    incidence_angle as incidence_angle,
    noisy_depth as noisy_depth,
)
from .depth_camera_presets import (
    NOISE_PRESETS as NOISE_PRESETS,
    SENSOR_PRESETS as SENSOR_PRESETS,
    DepthNoise as DepthNoise,
    Sensor as Sensor,
    depth_noise as depth_noise,
    scaled as scaled,
    sensor as sensor,
)
from .frame_processing import (
    FrameProcessor as FrameProcessor,
    LocatedFrame as LocatedFrame,
    ViewSettings as ViewSettings,
    change_settings as change_settings,
    check_settings as check_settings,
    describe_pose as describe_pose,
    placement_order as placement_order,
    position_sd as position_sd,
)
from .frame_source import (
    CameraLost as CameraLost,
    Frame as Frame,
    FrameSource as FrameSource,
    Image as Image,
)
from .image_files import (
    decode_image as decode_image,
    encode_jpeg as encode_jpeg,
    read_depth as read_depth,
    read_image as read_image,
    require_image_format as require_image_format,
    silence_opencv as silence_opencv,
    write_image as write_image,
)
from .image_systems import (
    CameraSource as CameraSource,
    DepthNoiseSystem as DepthNoiseSystem,
    SceneOverlay as SceneOverlay,
)
from .intrinsics import (
    IMAGE_PARTS as IMAGE_PARTS,
    NEAR_DISTANCE as NEAR_DISTANCE,
    FieldOfView as FieldOfView,
    Intrinsics as Intrinsics,
    camera_info as camera_info,
    camera_intrinsics as camera_intrinsics,
    describe_accuracy as describe_accuracy,
    fisheye_lens as fisheye_lens,
    of_camera_info as of_camera_info,
)
from .intrinsics_file import (
    ROS_FISHEYE_MODEL as ROS_FISHEYE_MODEL,
    ROS_LENS_MODELS as ROS_LENS_MODELS,
    SIMULATED_PREFIX as SIMULATED_PREFIX,
    is_ros_fisheye as is_ros_fisheye,
    load_intrinsics as load_intrinsics,
    save_camera_info as save_camera_info,
    save_intrinsics as save_intrinsics,
)
from .live_session import (
    Event as Event,
    EventLog as EventLog,
    FrameCounts as FrameCounts,
    FrameReader as FrameReader,
    LiveSession as LiveSession,
    Picture as Picture,
)
from .overlay import (
    VERDICT_COLORS as VERDICT_COLORS,
    Overlay as Overlay,
    OverlayStyle as OverlayStyle,
    correction_mark as correction_mark,
    instance_labels as instance_labels,
    rasterize_lines as rasterize_lines,
)
from .placement.alignment import fit_displacement as fit_displacement
from .placement.board_background import empty_board as empty_board
from .placement.check import Undistortion as Undistortion, check_placement as check_placement
from .placement.document import (
    CameraPlace as CameraPlace,
    CheckedImage as CheckedImage,
    CheckedScene as CheckedScene,
    ExtraObject as ExtraObject,
    Placement as Placement,
    PlacementCheck as PlacementCheck,
    combine_checks as combine_checks,
    describe_image_file as describe_image_file,
    load_placement as load_placement,
    save_placement as save_placement,
)
from .placement.localization import locate_objects as locate_objects
from .placement.misplaced_objects import (
    find_exchanged_objects as find_exchanged_objects,
    find_extra_objects as find_extra_objects,
)
from .placement.object_search import find_places as find_places
from .placement.object_shape import (
    TargetShape as TargetShape,
    target_shape as target_shape,
    target_shapes as target_shapes,
)
from .placement.photo_edges import StepLines as StepLines, fit_steps as fit_steps
from .placement.pinhole_view import (
    ImageContour as ImageContour,
    ImageWindow as ImageWindow,
    PinholeView as PinholeView,
    visible_outline as visible_outline,
)
from .placement.silhouette_aligner import SilhouetteAligner as SilhouetteAligner
from .pose.board_estimate import (
    BoardEstimate as BoardEstimate,
    LocatedCamera as LocatedCamera,
    locate_camera as locate_camera,
)
from .pose.board_pose import (
    BoardPose as BoardPose,
    estimate_board as estimate_board,
    grey_image as grey_image,
)
from .pose.edge_measurement import (
    NEIGHBOUR_EDGES as NEIGHBOUR_EDGES,
    EdgeViews as EdgeViews,
    marker_edges as marker_edges,
    perturbed_pose as perturbed_pose,
    project_edges as project_edges,
)
from .pose.marker_detection import (
    MIN_CELL_CONTRAST as MIN_CELL_CONTRAST,
    MarkerDetector as MarkerDetector,
    find_dark_quadrilaterals as find_dark_quadrilaterals,
    find_foreign_markers as find_foreign_markers,
    read_cells as read_cells,
)
from .pose.sheet_deviations import (
    Disturbance as Disturbance,
    DisturbanceFit as DisturbanceFit,
    SheetModes as SheetModes,
)
from .pose.wrong_board import WrongBoardCheck as WrongBoardCheck
from .pose_systems import (
    BoardPoseEstimator as BoardPoseEstimator,
    PoseFilter as PoseFilter,
    Track as Track,
)
from .recording import (
    Recording as Recording,
    RecordingDocument as RecordingDocument,
    read_poses as read_poses,
    require_video_path as require_video_path,
)
from .scene_mesh import (
    MeshOutline as MeshOutline,
    SceneMesh as SceneMesh,
    build_scene_mesh as build_scene_mesh,
)
from .scene_projection import (
    INNER_KIND as INNER_KIND,
    OUTLINE_KIND as OUTLINE_KIND,
    SurfaceCamera as SurfaceCamera,
    VisibleLines as VisibleLines,
    visible_lines as visible_lines,
)
from .simulated_source import SimulatedSource as SimulatedSource
from .snapshot import (
    SeenBoard as SeenBoard,
    Snapshot as Snapshot,
    SnapshotDocument as SnapshotDocument,
    describe_snapshot as describe_snapshot,
    load_snapshot as load_snapshot,
    next_free_path as next_free_path,
    require_new_folder as require_new_folder,
    save_snapshot as save_snapshot,
)
from .source_opening import (
    DeviceSource as DeviceSource,
    VideoSource as VideoSource,
    image_paths as image_paths,
    open_device as open_device,
    open_devices as open_devices,
    open_source as open_source,
)
from .text_tags import (
    draw_notice as draw_notice,
    draw_tags as draw_tags,
    find_tag_corners as find_tag_corners,
    render_tag as render_tag,
)
from .top_view import (
    BoardObservation as BoardObservation,
    BoardPicture as BoardPicture,
    BoardRectifier as BoardRectifier,
    board_observations as board_observations,
    board_picture as board_picture,
)
from .view_actions import ViewActions as ViewActions, placement_summary as placement_summary
from .visibility import visible_from as visible_from
