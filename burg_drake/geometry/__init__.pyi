from .body import (
    TOUCHING as TOUCHING,
    Body as Body,
)
from .convex import (
    Ball as Ball,
    Boxes as Boxes,
    Cylinder as Cylinder,
)
from .distance import (
    Cores as Cores,
    distances as distances,
)
from .hand_screen import HandScreen as HandScreen
from .hulls import (
    convex_hull as convex_hull,
    hull_mesh as hull_mesh,
    reduced_hull as reduced_hull,
    thickness as thickness,
)
from .polytope import Polytope as Polytope
from .poses import (
    Poses as Poses,
    rotate as rotate,
)
from .rays import (
    RayCaster as RayCaster,
)
from .shape import Shape as Shape
from .surface import Surface as Surface
from .swept import (
    swept_body as swept_body,
    swept_shape as swept_shape,
)
from .triangles import triangle_distances as triangle_distances
