from .images import (
    SURROUNDINGS as SURROUNDINGS,
    Images as Images,
)
from .ray_scene import (
    RayScene as RayScene,
    Silhouette as Silhouette,
    label_numbers as label_numbers,
)
from .render import (
    render as render,
    station_view as station_view,
)
from .scene_renderer import (
    KINDS as KINDS,
    ImageKind as ImageKind,
    SceneRenderer as SceneRenderer,
)
