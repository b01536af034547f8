from .contact import contact_geometry as contact_geometry
from .decomposition import (
    Pieces as Pieces,
    convex_pieces as convex_pieces,
    given_pieces as given_pieces,
)
from .fit import (
    coarse_note as coarse_note,
    coarseness as coarseness,
    describe_fit as describe_fit,
    measure_fit as measure_fit,
)
from .primitive import primitive_mesh as primitive_mesh
