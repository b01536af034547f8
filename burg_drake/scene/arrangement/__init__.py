"""Room for objects: laid out at random, packed, or hung above a heap.

Read `arranging` first; it asks `occupancy`, which moves shapes by `sweep` and `polygons`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
