from .images import (
    Images as Images,
)
from .one_view import (
    render as render,
    station_view as station_view,
)
from .ray_scene import (
    RayScene as RayScene,
    Silhouette as Silhouette,
)
from .ray_surface import RaySurface as RaySurface
from .scene_renderer import (
    ImageKind as ImageKind,
    SceneRenderer as SceneRenderer,
)
