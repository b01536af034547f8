from .closed_surfaces import (
    decimate as decimate,
    is_closed as is_closed,
    one_sided_hausdorff as one_sided_hausdorff,
    unite_bodies as unite_bodies,
)
from .coacd_process import DecompositionFailed as DecompositionFailed, run_coacd as run_coacd
from .contact import (
    CONTACT_FILE as CONTACT_FILE,
    CONTACT_MESH_FACES as CONTACT_MESH_FACES,
    MAX_CONTACT_DISTANCE as MAX_CONTACT_DISTANCE,
    MAX_NORMAL_ANGLE as MAX_NORMAL_ANGLE,
    MAX_TURNED_SHARE as MAX_TURNED_SHARE,
    SurfaceNormals as SurfaceNormals,
    contact_fallback_message as contact_fallback_message,
    contact_geometry as contact_geometry,
    contact_surface as contact_surface,
    describe_pad_contact as describe_pad_contact,
    max_excess as max_excess,
    min_face_height as min_face_height,
)
from .convex_decomposition import (
    ConvexPieces as ConvexPieces,
    check_given_pieces as check_given_pieces,
    convex_pieces as convex_pieces,
    join_parts as join_parts,
)
from .library import (
    CONTACT_KINDS as CONTACT_KINDS,
    DEFAULT_FRICTION as DEFAULT_FRICTION,
    LIBRARY_FILE as LIBRARY_FILE,
    UPRIGHT_TOLERANCE as UPRIGHT_TOLERANCE,
    ContactGeometry as ContactGeometry,
    ContactKind as ContactKind,
    Decomposition as Decomposition,
    Fit as Fit,
    Inertia as Inertia,
    LibraryDocument as LibraryDocument,
    LibraryLike as LibraryLike,
    MassProperties as MassProperties,
    ObjectEntry as ObjectEntry,
    ObjectLibrary as ObjectLibrary,
    Primitive as Primitive,
    Source as Source,
    StablePose as StablePose,
    as_library as as_library,
    load_library as load_library,
    package_manifest as package_manifest,
    package_name as package_name,
)
from .mass import (
    DEFAULT_DENSITY as DEFAULT_DENSITY,
    Solid as Solid,
    implausible_properties as implausible_properties,
    inertia_matrix as inertia_matrix,
    mass_properties as mass_properties,
    solid_of_pieces as solid_of_pieces,
    solid_of_shell as solid_of_shell,
    solid_of_surface as solid_of_surface,
)
from .mesh_file import (
    MESH_FORMATS as MESH_FORMATS,
    STL_HEADER_BYTES as STL_HEADER_BYTES,
    STL_TRIANGLE_BYTES as STL_TRIANGLE_BYTES,
    announced_triangle_count as announced_triangle_count,
    find_companion_files as find_companion_files,
    mesh_hash as mesh_hash,
    missing_textures as missing_textures,
    read_mesh as read_mesh,
    texture_image as texture_image,
)
from .mesh_loading import (
    Preparation as Preparation,
    SurfaceMesh as SurfaceMesh,
    check_size as check_size,
    load_mesh as load_mesh,
    read_piece as read_piece,
)
from .mesh_repair import (
    MAX_SELF_OVERLAP as MAX_SELF_OVERLAP,
    RepairedMesh as RepairedMesh,
    boundary_loops as boundary_loops,
    connected_bodies as connected_bodies,
    repair as repair,
    self_overlap as self_overlap,
)
from .model_files import (
    DEFAULT_CONTACT as DEFAULT_CONTACT,
    DEFAULT_RGBA as DEFAULT_RGBA,
    LINK_NAME as LINK_NAME,
    ContactParameters as ContactParameters,
    corner_normals as corner_normals,
    face_palette as face_palette,
    model_sdf as model_sdf,
    resolution_hint as resolution_hint,
    write_piece as write_piece,
    write_visual as write_visual,
)
from .open_surfaces import (
    Openings as Openings,
    close_openings as close_openings,
    default_wall as default_wall,
    separate_faces as separate_faces,
    thicken_sheet as thicken_sheet,
)
from .primitives import (
    fit_primitive as fit_primitive,
    hull_corners as hull_corners,
    nearest_primitive as nearest_primitive,
    primitive_mesh as primitive_mesh,
    primitive_volume as primitive_volume,
    support_corners as support_corners,
)
from .resting_poses import (
    PoseClasses as PoseClasses,
    PotentialLandscape as PotentialLandscape,
    angle_between as angle_between,
    resting_pose as resting_pose,
    stable_poses as stable_poses,
)
from .shape_fit import (
    describe_fit as describe_fit,
    deviation_warning as deviation_warning,
    measure_fit as measure_fit,
    relative_deviation as relative_deviation,
    surface_distance as surface_distance,
    surface_overlap as surface_overlap,
    union_mesh as union_mesh,
)
from .support_points import (
    HULL_TOLERANCE as HULL_TOLERANCE,
    MAX_CARRYING_CORNERS as MAX_CARRYING_CORNERS,
    ROLLING_TOLERANCE as ROLLING_TOLERANCE,
    SUPPORT_HEIGHT_TOLERANCE as SUPPORT_HEIGHT_TOLERANCE,
    carrying_corners as carrying_corners,
    support_feet as support_feet,
)
from .symmetry import (
    Symmetries as Symmetries,
    SymmetrySearch as SymmetrySearch,
    sample_surface as sample_surface,
)
from .units import UNITS as UNITS, unit_scale as unit_scale
