from .scene_check import (
    DEEPEST as DEEPEST,
    SceneCheck as SceneCheck,
)
from .scene_issues import (
    check_scene as check_scene,
    overlaps as overlaps,
    surface_issues as surface_issues,
)
from .valid_scene import require_valid_scene as require_valid_scene
