from .check import check_placement as check_placement
from .document import (
    CheckedScene as CheckedScene,
    Placement as Placement,
    PlacementCheck as PlacementCheck,
    camera_versions as camera_versions,
    image_of_file as image_of_file,
    load_placement as load_placement,
    save_placement as save_placement,
)
