from .estimation import (
    Calibration as Calibration,
    calibrate_views as calibrate_views,
)
from .lens_uncertainty import (
    image_grid as image_grid,
    uncertainty as uncertainty,
)
from .quality import (
    CELLS as CELLS,
    advice as advice,
    coverage as coverage,
    is_useless as is_useless,
)
from .target import (
    CharucoTarget as CharucoTarget,
    CharucoView as CharucoView,
    find_target as find_target,
)
from .target_sheet import write_target as write_target
from .view_collector import ViewCollector as ViewCollector
