from .cleaning import signed_volume as signed_volume
from .mesh_file import (
    companions as companions,
    missing_textures as missing_textures,
)
from .offset import (
    folded as folded,
    offsets as offsets,
)
from .openings import Openings as Openings
from .solids import (
    coarser_surfaces as coarser_surfaces,
    decimated as decimated,
)
from .surface import (
    FORMATS as FORMATS,
    UNITS as UNITS,
    Preparation as Preparation,
    SurfaceMesh as SurfaceMesh,
    check_size as check_size,
    load_mesh as load_mesh,
    mesh_hash as mesh_hash,
    read_piece as read_piece,
    texture_image as texture_image,
    unit_scale as unit_scale,
)
