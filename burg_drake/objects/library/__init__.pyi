from .document import (
    LIBRARY_FILE as LIBRARY_FILE,
    LibraryDocument as LibraryDocument,
    ObjectLibrary as ObjectLibrary,
    load_library as load_library,
    package_manifest as package_manifest,
    package_name as package_name,
)
from .entry import (
    CONTACT_KINDS as CONTACT_KINDS,
    DEFAULT_FRICTION as DEFAULT_FRICTION,
    UPRIGHT_TOLERANCE as UPRIGHT_TOLERANCE,
    ContactGeometry as ContactGeometry,
    ContactKind as ContactKind,
    Decomposition as Decomposition,
    Fit as Fit,
    Inertia as Inertia,
    MassProperties as MassProperties,
    ObjectEntry as ObjectEntry,
    Primitive as Primitive,
    Source as Source,
    StablePose as StablePose,
)
from .obj_file import (
    DEFAULT_RGBA as DEFAULT_RGBA,
    face_palette as face_palette,
    write_piece as write_piece,
    write_visual as write_visual,
)
from .sdf import (
    DEFAULT_CONTACT as DEFAULT_CONTACT,
    LINK as LINK,
    model_sdf as model_sdf,
    resolution_hint as resolution_hint,
)
