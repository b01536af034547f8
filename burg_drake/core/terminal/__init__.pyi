from .colors import (
    CATEGORIES as CATEGORIES,
    Rgba as Rgba,
    distinct_colors as distinct_colors,
)
from .number_text import (
    MISSING as MISSING,
    count as count,
    duration as duration,
    figure as figure,
    percent as percent,
)
from .progress import (
    STARTING as STARTING,
    Listener as Listener,
    Pace as Pace,
    Progress as Progress,
    Reporter as Reporter,
)
from .text_table import TextTable as TextTable
