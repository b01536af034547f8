from .calibration.estimation import (
    CalibratedView as CalibratedView,
    Calibration as Calibration,
    calibrate as calibrate,
)
from .calibration.lens_uncertainty import LensHypothesis as LensHypothesis
from .calibration.promise import Promise as Promise
from .calibration.target import (
    CharucoTarget as CharucoTarget,
    CharucoView as CharucoView,
)
from .live.event_log import (
    Event as Event,
    EventLog as EventLog,
)
from .live.frame_processing import (
    FrameProcessor as FrameProcessor,
    LocatedFrame as LocatedFrame,
    ViewSettings as ViewSettings,
)
from .live.picture import Picture as Picture
from .live.session import (
    FrameCounts as FrameCounts,
    LiveSession as LiveSession,
)
from .live.snapshot import (
    SeenBoard as SeenBoard,
    Snapshot as Snapshot,
    SnapshotDocument as SnapshotDocument,
    load_snapshot as load_snapshot,
)
from .noise.document import (
    DepthNoise as DepthNoise,
    depth_noise as depth_noise,
)
from .noise.measurement import noisy_depth as noisy_depth
from .optics.intrinsics import (
    Intrinsics as Intrinsics,
    camera_info as camera_info,
    of_camera_info as of_camera_info,
)
from .optics.intrinsics_file import load_intrinsics as load_intrinsics
from .optics.sensors import (
    Sensor as Sensor,
    scaled as scaled,
    sensor as sensor,
)
from .overlay.renderer import (
    Overlay as Overlay,
    instance_labels as instance_labels,
)
from .overlay.style import OverlayStyle as OverlayStyle
from .placement.check import check_placement as check_placement
from .placement.combination import combine_checks as combine_checks
from .placement.document import (
    CameraPlace as CameraPlace,
    CheckedImage as CheckedImage,
    CheckedScene as CheckedScene,
    ExtraObject as ExtraObject,
    Placement as Placement,
    PlacementCheck as PlacementCheck,
    load_placement as load_placement,
)
from .pose.camera_location import (
    LocatedCamera as LocatedCamera,
    locate_camera as locate_camera,
)
from .pose.estimate import BoardEstimate as BoardEstimate
from .pose.estimator import (
    BoardPose as BoardPose,
    estimate_board as estimate_board,
)
from .projection.visibility import visible_from as visible_from
from .rectification.stream import (
    BoardObservation as BoardObservation,
    board_observations as board_observations,
)
from .rectification.top_view import (
    BoardPicture as BoardPicture,
    BoardRectifier as BoardRectifier,
    board_picture as board_picture,
)
from .sources.frame import (
    CameraLost as CameraLost,
    Frame as Frame,
    FrameSource as FrameSource,
)
from .sources.opening import open_source as open_source
from .systems.board_loop import (
    BoardLoop as BoardLoop,
    LoopCamera as LoopCamera,
    build_board_loop as build_board_loop,
)
from .systems.camera_source import CameraSource as CameraSource
from .systems.depth_noise_system import DepthNoiseSystem as DepthNoiseSystem
from .systems.pose_estimator import BoardPoseEstimator as BoardPoseEstimator
from .systems.pose_filter import (
    PoseFilter as PoseFilter,
    Track as Track,
)
from .systems.scene_overlay import SceneOverlay as SceneOverlay
