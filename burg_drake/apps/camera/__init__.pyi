from .placement import (
    extra_line as extra_line,
    placement_table as placement_table,
)
from .verbs import add_to as add_to
