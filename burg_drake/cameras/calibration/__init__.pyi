from .estimation import (
    Calibration as Calibration,
    calibrate_views as calibrate_views,
)
from .image_parts import (
    CELLS as CELLS,
    coverage as coverage,
)
from .lens_uncertainty import (
    BOUND as BOUND,
    image_grid as image_grid,
    uncertainty as uncertainty,
)
from .quality import (
    advice as advice,
    is_useless as is_useless,
)
from .target import (
    CharucoTarget as CharucoTarget,
    CharucoView as CharucoView,
    find_target as find_target,
)
from .target_sheet import write_target as write_target
from .view_collector import ViewCollector as ViewCollector
