from .groups import by_outcome as by_outcome
from .legend import (
    color_by as color_by,
    default_column as default_column,
    group_entries as group_entries,
    with_unit as with_unit,
)
from .mesh import (
    GRASPS_PATH as GRASPS_PATH,
    draw_grasps as draw_grasps,
    grasp_triangles as grasp_triangles,
)
from .picker import GraspPicker as GraspPicker
from .strokes import (
    grasp_corners as grasp_corners,
    grasp_strokes as grasp_strokes,
)
