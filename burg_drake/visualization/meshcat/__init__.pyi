from .camera_aim import (
    VIEW_ASPECT as VIEW_ASPECT,
    aim_at as aim_at,
    looking as looking,
)
from .flat_mesh import draw_flat as draw_flat
from .gltf import (
    gltf_mesh as gltf_mesh,
    label_mesh as label_mesh,
    picture_mesh as picture_mesh,
)
from .gripper_view import (
    GRIPPER_PATH as GRIPPER_PATH,
    GripperView as GripperView,
)
from .hand_visual import (
    HandVisual as HandVisual,
    hand_visuals as hand_visuals,
)
from .hydroelastic_mesh import (
    HIGH_PRESSURE as HIGH_PRESSURE,
    HydroelasticMesh as HydroelasticMesh,
    cut_open as cut_open,
    hydroelastic_meshes as hydroelastic_meshes,
    pressure_colors as pressure_colors,
)
from .portrait import (
    best_yaw as best_yaw,
    camera_rotation as camera_rotation,
    fit_camera as fit_camera,
    upright as upright,
)
from .text import text_triangles as text_triangles
from .triad import (
    TriadStyle as TriadStyle,
    draw_triad as draw_triad,
)
