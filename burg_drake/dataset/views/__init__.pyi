from .sampler import ViewSampler as ViewSampler
from .settings import ViewpointSettings as ViewpointSettings
from .view import (
    View as View,
)
