from .camera_location import locate_camera as locate_camera
from .coarse import MISPLACED as MISPLACED
from .detection import (
    MarkerDetector as MarkerDetector,
    other_markers as other_markers,
    side_lengths as side_lengths,
)
from .edge_projection import perturbed_pose as perturbed_pose
from .estimate import BoardEstimate as BoardEstimate
from .estimator import (
    BoardPose as BoardPose,
    grey_image as grey_image,
)
