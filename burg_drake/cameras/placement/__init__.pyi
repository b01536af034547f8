from .check import check_placement as check_placement
from .combination import combine_checks as combine_checks
from .document import (
    CheckedScene as CheckedScene,
    ExtraObject as ExtraObject,
    Placement as Placement,
    PlacementCheck as PlacementCheck,
    camera_versions as camera_versions,
    image_of_file as image_of_file,
    load_placement as load_placement,
    save_placement as save_placement,
)
