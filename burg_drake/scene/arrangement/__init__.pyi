from .arranging import (
    arrange as arrange,
    choose as choose,
)
from .heap import Heap as Heap
from .object_shapes import ObjectShapes as ObjectShapes
from .occupancy import (
    ObjectRequest as ObjectRequest,
    OccupiedBoard as OccupiedBoard,
)
from .polygons import (
    area as area,
    convex_polygon as convex_polygon,
    distances as distances,
    no_fit_polygon as no_fit_polygon,
    simplified as simplified,
)
from .sweep import (
    ConvexShapes as ConvexShapes,
    contact_distances as contact_distances,
)
