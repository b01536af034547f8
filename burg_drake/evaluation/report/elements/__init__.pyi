from .blocks import (
    Child as Child,
    Html as Html,
    command as command,
    element as element,
    folded as folded,
    join as join,
    section as section,
    table as table,
)
from .charts import (
    BarPart as BarPart,
    Series as Series,
    interval_mark as interval_mark,
    legend as legend,
    nice_step as nice_step,
    stacked_bar as stacked_bar,
)
from .drawings import (
    DrawnGrasps as DrawnGrasps,
    grasp_drawing as grasp_drawing,
    scene_drawing as scene_drawing,
    solid_of as solid_of,
)
from .mirrored import (
    Limit as Limit,
    mirrored_histogram as mirrored_histogram,
)
from .outcome_groups import (
    LIFTED as LIFTED,
    group_indices as group_indices,
    group_legend as group_legend,
    groups_of_codes as groups_of_codes,
    present as present,
)
from .page_frame import (
    closing_section as closing_section,
    header as header,
    html_page as html_page,
    tiles as tiles,
)
from .style import STYLES as STYLES
