from . import palette as palette
from .color_map import (
    contrast as contrast,
    hex_color as hex_color,
    linear_light as linear_light,
    map_colors as map_colors,
)
from .color_scale import (
    BINS as BINS,
    ColorScale as ColorScale,
    scale_of as scale_of,
)
from .html_page import (
    html_document as html_document,
    page_style as page_style,
)
from .legend import (
    SCRIPT as SCRIPT,
    STYLE as STYLE,
    ColorBar as ColorBar,
    LegendEntry as LegendEntry,
    legend_html as legend_html,
)
from .markup import (
    Child as Child,
    Html as Html,
    element as element,
    join as join,
)
from .palette import (
    GROUPS as GROUPS,
    OTHERS as OTHERS,
    UNJUDGED as UNJUDGED,
    UNKNOWN as UNKNOWN,
    Rgba as Rgba,
    group_of as group_of,
)
