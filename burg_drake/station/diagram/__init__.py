"""The one builder of Drake diagrams, and handles of the robot in them.

Read `builder` and `station_diagram` first, then `floating_hand` and `mounted_hand`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
