from .calibration_report import write_report as write_report
from .contact_sheet import (
    grams as grams,
    share as share,
    write_contact_sheet as write_contact_sheet,
)
from .flat_view import (
    FlatView as FlatView,
    fit_view as fit_view,
    path_data as path_data,
)
from .reach_raster import reach_image as reach_image
from .reachability_svg import (
    outlines as outlines,
    reachability_chart as reachability_chart,
    reachability_key as reachability_key,
)
from .shaded_drawing import (
    SolidMesh as SolidMesh,
    footprint as footprint,
    grounded as grounded,
    shaded_outline as shaded_outline,
    surface_of as surface_of,
)
from .shadow import painted_shadow as painted_shadow
from .thumbnails import (
    ObjectRenderer as ObjectRenderer,
    exploded as exploded,
)
