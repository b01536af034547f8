from .placement import placement_table as placement_table
from .verbs import add_to as add_to
