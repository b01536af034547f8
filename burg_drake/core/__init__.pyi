from .arrays import (
    Array as Array,
    Booleans as Booleans,
    Bytes as Bytes,
    Indices as Indices,
    Single as Single,
)
from .cache import (
    Arrays as Arrays,
    cache_folder as cache_folder,
    cached as cached,
)
from .content import (
    content_hash as content_hash,
    rng_from as rng_from,
)
from .errors import (
    BurgError as BurgError,
    ClusterError as ClusterError,
    DocumentError as DocumentError,
    FieldError as FieldError,
    InvalidInputError as InvalidInputError,
    MeshError as MeshError,
    MissingDependencyError as MissingDependencyError,
    SimulationError as SimulationError,
    TaskCancelled as TaskCancelled,
    UnknownNameError as UnknownNameError,
    WorkerDied as WorkerDied,
    did_you_mean as did_you_mean,
    listing as listing,
    nearest as nearest,
    one_line as one_line,
    quoted as quoted,
    shown as shown,
)
from .frames import (
    canonical_fingers as canonical_fingers,
    check_pose as check_pose,
    grasp_from_axes as grasp_from_axes,
    inverse as inverse,
    make_pose as make_pose,
    perpendicular as perpendicular,
    pregrasp as pregrasp,
    quaternion_from_rotation as quaternion_from_rotation,
    rot_z as rot_z,
    rotation_angle as rotation_angle,
    rotation_from_quaternion as rotation_from_quaternion,
    rotation_from_rpy as rotation_from_rpy,
    rpy_from_rotation as rpy_from_rotation,
    swap_fingers as swap_fingers,
    transform_points as transform_points,
)
from .light import (
    even_levels as even_levels,
    levels_of_light as levels_of_light,
    photo_light as photo_light,
)
from .settings import (
    DEGREES as DEGREES,
    LARGEST_SEED as LARGEST_SEED,
    MILLIMETRES as MILLIMETRES,
    PERCENT as PERCENT,
    THOUSANDTHS as THOUSANDTHS,
    Setting as Setting,
    ShownUnit as ShownUnit,
    declared as declared,
    option_of as option_of,
    setting as setting,
)
from .statistics import (
    Z_95 as Z_95,
    clustered_interval as clustered_interval,
    wilson_interval as wilson_interval,
)
from .versions import (
    JUDGING as JUDGING,
    software_versions as software_versions,
)
from .web_access import (
    HEADERS as HEADERS,
    LOCALHOST as LOCALHOST,
    RequestError as RequestError,
    address_in_use_error as address_in_use_error,
    page_url as page_url,
    require_local_host as require_local_host,
)
from .web_token import BrowserToken as BrowserToken
