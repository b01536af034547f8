from .sampler import (
    ViewSampler as ViewSampler,
    require_cameras as require_cameras,
)
from .settings import ViewpointSettings as ViewpointSettings
from .surroundings import (
    PlacedBox as PlacedBox,
    box_around as box_around,
)
from .view import (
    View as View,
)
