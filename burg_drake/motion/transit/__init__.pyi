from .home_tree import HomeTree as HomeTree
from .object_postures import postures_over_objects as postures_over_objects
