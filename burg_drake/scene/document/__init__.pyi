from .board import Board as Board
from .files import scene_references as scene_references
from .layout import (
    LAYOUTS as LAYOUTS,
    TRIES as TRIES,
    LayoutName as LayoutName,
    PoseChoice as PoseChoice,
)
from .markers import (
    EDGE as EDGE,
    MarkerLayout as MarkerLayout,
    Markers as Markers,
    marker_dictionary as marker_dictionary,
)
from .origin import (
    SamplingProvenance as SamplingProvenance,
    SceneOrigin as SceneOrigin,
)
from .recipe import SceneRecipe as SceneRecipe
from .scene import (
    Instance as Instance,
    Scene as Scene,
    SceneDocument as SceneDocument,
    SceneLike as SceneLike,
    as_scene as as_scene,
    load_scene as load_scene,
    save_scene as save_scene,
)
from .validation import (
    BOARD_NAME as BOARD_NAME,
    GROUND_TOLERANCE as GROUND_TOLERANCE,
    HOVER_TOLERANCE as HOVER_TOLERANCE,
    IN_BOUNDS_TOLERANCE as IN_BOUNDS_TOLERANCE,
    SINK_TOLERANCE as SINK_TOLERANCE,
    SUNKEN_TOLERANCE as SUNKEN_TOLERANCE,
    TOUCH_TOLERANCE as TOUCH_TOLERANCE,
    Extent as Extent,
    SceneIssue as SceneIssue,
    hovering_issue as hovering_issue,
    is_below as is_below,
    length_text as length_text,
    placed_vertices as placed_vertices,
    read_vertices as read_vertices,
    require_no_errors as require_no_errors,
    support_vertices as support_vertices,
    surface_vertices as surface_vertices,
    validate_scene as validate_scene,
)
