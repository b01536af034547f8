from .images import (
    SURROUNDINGS as SURROUNDINGS,
    Images as Images,
)
from .ray_scene import (
    RayScene as RayScene,
    Silhouette as Silhouette,
    label_numbers as label_numbers,
)
from .scene_renderer import (
    KINDS as KINDS,
    ImageKind as ImageKind,
    SceneRenderer as SceneRenderer,
)
