from .colors import (
    CATEGORIES as CATEGORIES,
    Rgb as Rgb,
    Rgba as Rgba,
    distinct_colors as distinct_colors,
)
from .number_text import (
    MISSING as MISSING,
    format_count as format_count,
    format_duration as format_duration,
    format_number as format_number,
    format_percent as format_percent,
)
from .progress import (
    STARTING as STARTING,
    Listener as Listener,
    Progress as Progress,
    ProgressMeter as ProgressMeter,
    Reporter as Reporter,
)
from .text_table import TextTable as TextTable
