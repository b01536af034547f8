from .pose_filter import (
    PoseFilter as PoseFilter,
    Track as Track,
)
