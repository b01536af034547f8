from .sampler import (
    ViewSampler as ViewSampler,
    require_cameras as require_cameras,
)
from .settings import ViewpointSettings as ViewpointSettings
from .view import (
    View as View,
)
