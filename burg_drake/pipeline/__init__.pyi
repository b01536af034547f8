from .build_record import read_record as read_record
from .collection_imports import (
    burg_names as burg_names,
    burg_sources as burg_sources,
    compare_poses as compare_poses,
    fixed_note as fixed_note,
    import_burg_scene as import_burg_scene,
    ycb_sources as ycb_sources,
)
from .library_build import (
    BuildReport as BuildReport,
    build_library as build_library,
    open_for_build as open_for_build,
)
from .library_check import check_library as check_library
from .library_recipe import (
    Cutting as Cutting,
    Defaults as Defaults,
    RecipeDocument as RecipeDocument,
    RecipeObject as RecipeObject,
    load_recipe as load_recipe,
)
from .object_source import (
    ObjectSource as ObjectSource,
    check_source as check_source,
    object_name as object_name,
)
