"""What stands in a plant: robot, objects, table, board, obstacles and cameras.

Read `robot`, `instances` and `surroundings` first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
