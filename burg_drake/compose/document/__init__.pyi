from .bounds_on_board import (
    bounds as bounds,
    nearest_stable_pose as nearest_stable_pose,
    object_bounds as object_bounds,
    object_shadow as object_shadow,
    object_vertices as object_vertices,
    shadow as shadow,
    yaw_between as yaw_between,
)
from .checker import (
    SceneChecker as SceneChecker,
    known_scene as known_scene,
    missing_objects as missing_objects,
    shapes_for as shapes_for,
    with_missing_objects as with_missing_objects,
)
from .free_place import (
    free_offset as free_offset,
    free_spot as free_spot,
)
from .history import (
    Amending as Amending,
    History as History,
    HistoryStep as HistoryStep,
)
from .state import (
    State as State,
    name_of as name_of,
    named as named,
    require_some as require_some,
    unused_name as unused_name,
)
from .surroundings import Surroundings as Surroundings
