from .library.document import LibraryDocument as LibraryDocument
from .library.entry import (
    ContactGeometry as ContactGeometry,
    Decomposition as Decomposition,
    Fit as Fit,
    MassProperties as MassProperties,
    ObjectEntry as ObjectEntry,
    Primitive as Primitive,
    Source as Source,
    StablePose as StablePose,
)
from .meshes.units import unit_scale as unit_scale
