from .focus import postures_over_objects as postures_over_objects
from .home_tree import HomeTree as HomeTree
