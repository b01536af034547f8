from .build import (
    BuildReport as BuildReport,
    build_library as build_library,
)
from .check import check_library as check_library
from .object_imports import (
    burg_names as burg_names,
    burg_sources as burg_sources,
    compare_poses as compare_poses,
    fixed_note as fixed_note,
    ycb_sources as ycb_sources,
)
from .recipe import load_recipe as load_recipe
from .scene_imports import import_burg_scene as import_burg_scene
from .source import (
    ObjectSource as ObjectSource,
    object_name as object_name,
)
