from .contact import (
    contact_geometry as contact_geometry,
    pieces_instead as pieces_instead,
    touched_by_pads as touched_by_pads,
)
from .decomposition import (
    Pieces as Pieces,
    convex_pieces as convex_pieces,
    given_pieces as given_pieces,
)
from .feet import (
    FLAT as FLAT,
    carrying_corners as carrying_corners,
    support_feet as support_feet,
)
from .fit import (
    describe_fit as describe_fit,
    deviation as deviation,
    deviation_warning as deviation_warning,
    measure_fit as measure_fit,
    surface_overlap as surface_overlap,
)
from .object_hull import (
    hull_corners as hull_corners,
    support_corners as support_corners,
)
from .primitive import primitive_mesh as primitive_mesh
