from .model_files import (
    named_files as named_files,
    named_packages as named_packages,
    names_elsewhere as names_elsewhere,
)
from .names import (
    LONGEST as LONGEST,
    name_from as name_from,
    require_name as require_name,
    require_names as require_names,
)
from .object_files import (
    MESH_FILE as MESH_FILE,
    SURFACE_FILE as SURFACE_FILE,
)
from .packages import (
    DRAKE_MODELS as DRAKE_MODELS,
    MANIFEST as MANIFEST,
    NO_PACKAGES as NO_PACKAGES,
    Packages as Packages,
)
from .references import (
    is_resolved as is_resolved,
    portable_reference as portable_reference,
    with_resolved_references as with_resolved_references,
    with_shareable_references as with_shareable_references,
)
from .resources import (
    BURG_DRAKE as BURG_DRAKE,
    PACKAGE_URI as PACKAGE_URI,
    builtin_names as builtin_names,
    data_root as data_root,
    expanded as expanded,
    resolve as resolve,
)
