"""Camera images in, poses and pictures out: calibration, board pose, overlay, placement check.

`intrinsics` describes a camera, `frame_source` and `source_opening` read its images, and `pose`
finds the board in them. `scene_projection`, `overlay` and `placement` build on that. The modules
`*_systems` and `live_session` put it all together.
"""

import lazy_loader

__getattr__, _, _ = lazy_loader.attach_stub(__name__, __file__)

__all__ = [
    "BoardEstimate",
    "BoardLoop",
    "BoardObservation",
    "BoardPicture",
    "BoardPose",
    "BoardPoseEstimator",
    "BoardRectifier",
    "CalibratedView",
    "Calibration",
    "CalibrationAccuracy",
    "CameraLost",
    "CameraPlace",
    "CameraSource",
    "CharucoTarget",
    "CharucoView",
    "CheckedImage",
    "CheckedScene",
    "DepthNoise",
    "DepthNoiseSystem",
    "Event",
    "EventLog",
    "ExtraObject",
    "Frame",
    "FrameCounts",
    "FrameProcessor",
    "FrameSource",
    "Intrinsics",
    "LensHypothesis",
    "LiveSession",
    "LocatedCamera",
    "LocatedFrame",
    "LoopCamera",
    "Overlay",
    "OverlayStyle",
    "Picture",
    "Placement",
    "PlacementCheck",
    "PoseFilter",
    "SceneOverlay",
    "SeenBoard",
    "Sensor",
    "Snapshot",
    "SnapshotDocument",
    "Track",
    "ViewSettings",
    "board_observations",
    "board_picture",
    "build_board_loop",
    "calibrate",
    "camera_info",
    "check_placement",
    "combine_checks",
    "depth_noise",
    "estimate_board",
    "instance_labels",
    "load_intrinsics",
    "load_placement",
    "load_snapshot",
    "locate_camera",
    "noisy_depth",
    "of_camera_info",
    "open_source",
    "scaled",
    "sensor",
    "visible_from",
]


def __dir__() -> list[str]:
    return __all__
