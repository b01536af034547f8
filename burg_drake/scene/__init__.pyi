from .arrangement import Heap as Heap, arrange as arrange, choose_objects as choose_objects
from .convex_sweep import ConvexShapes as ConvexShapes, contact_distances as contact_distances
from .object_shapes import ObjectShapes as ObjectShapes
from .occupancy import (
    Arrangement as Arrangement,
    ObjectRequest as ObjectRequest,
    OccupiedBoard as OccupiedBoard,
    draw_pose as draw_pose,
)
from .polygons import (
    convex_polygon as convex_polygon,
    distances_from_polygon as distances_from_polygon,
    no_fit_polygon as no_fit_polygon,
    polygon_area as polygon_area,
    simplify_polygon as simplify_polygon,
)
from .scene_document import (
    LAYOUT_NAMES as LAYOUT_NAMES,
    MARKER_EDGE_MARGIN as MARKER_EDGE_MARGIN,
    Board as Board,
    Instance as Instance,
    LayoutName as LayoutName,
    MarkerLayout as MarkerLayout,
    Markers as Markers,
    PoseChoice as PoseChoice,
    SamplingProvenance as SamplingProvenance,
    Scene as Scene,
    SceneDocument as SceneDocument,
    SceneLike as SceneLike,
    SceneOrigin as SceneOrigin,
    SceneRecipe as SceneRecipe,
    as_scene as as_scene,
    load_scene as load_scene,
    marker_dictionary as marker_dictionary,
    marker_layout as marker_layout,
    place_objects as place_objects,
    save_scene as save_scene,
    scene_references as scene_references,
)
from .scene_validation import (
    BOARD_NAME as BOARD_NAME,
    GROUND_TOLERANCE as GROUND_TOLERANCE,
    HOVER_TOLERANCE as HOVER_TOLERANCE,
    IN_BOUNDS_TOLERANCE as IN_BOUNDS_TOLERANCE,
    OBSTACLE_TOLERANCE as OBSTACLE_TOLERANCE,
    SUNKEN_TOLERANCE as SUNKEN_TOLERANCE,
    TOUCH_TOLERANCE as TOUCH_TOLERANCE,
    Extent as Extent,
    SceneIssue as SceneIssue,
    hovering_issue as hovering_issue,
    length_text as length_text,
    placed_vertices as placed_vertices,
    reaches_into_ground as reaches_into_ground,
    read_vertices as read_vertices,
    require_no_errors as require_no_errors,
    support_vertices as support_vertices,
    surface_vertices as surface_vertices,
    validate_scene as validate_scene,
)
