from .sampler import ViewSampler as ViewSampler
from .settings import ViewpointSettings as ViewpointSettings
from .view import (
    DEPTH_RANGE as DEPTH_RANGE,
    View as View,
)
