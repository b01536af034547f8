from .ground_outline import footprints as footprints
from .line_drawing import (
    OUTLINE as OUTLINE,
    VisibleLines as VisibleLines,
    clip_lines as clip_lines,
    visible_lines as visible_lines,
)
from .mesh_outline import (
    MeshOutline as MeshOutline,
)
from .scene_mesh import (
    SceneMesh as SceneMesh,
    build_scene_mesh as build_scene_mesh,
)
from .surface_image import (
    NOTHING as NOTHING,
    SurfaceCamera as SurfaceCamera,
    SurfaceImage as SurfaceImage,
)
from .visibility import visible_from as visible_from
