from .bodies import (
    CONTACT_TOLERANCE as CONTACT_TOLERANCE,
    SWEPT_CYLINDER_SIDES as SWEPT_CYLINDER_SIDES,
    Body as Body,
    swept_body as swept_body,
    swept_shape as swept_shape,
)
from .convex_distance import (
    DISTANCE_TOLERANCE as DISTANCE_TOLERANCE,
    ShapeBatch as ShapeBatch,
    shape_distances as shape_distances,
    triangle_distances as triangle_distances,
)
from .convex_shapes import (
    Ball as Ball,
    Boxes as Boxes,
    Convex as Convex,
    Cylinder as Cylinder,
    Hull as Hull,
    Shape as Shape,
    penetration_depths as penetration_depths,
)
from .hand_screen import HandScreen as HandScreen
from .polytopes import (
    Polytope as Polytope,
    convex_hull as convex_hull,
    hull_mesh as hull_mesh,
    reduced_hull as reduced_hull,
    thickness as thickness,
)
from .poses import Poses as Poses, rotate as rotate
from .ray_casting import MAX_HITS as MAX_HITS, RayCaster as RayCaster, Surface as Surface
