from .images import (
    Images as Images,
    instance_numbers as instance_numbers,
)
from .one_view import (
    render as render,
    station_view as station_view,
)
from .ray_scene import (
    Silhouette as Silhouette,
)
from .scene_renderer import (
    ImageKind as ImageKind,
    SceneRenderer as SceneRenderer,
)
