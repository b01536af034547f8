"""The trials on the robot: which grasps, in which order, and what became of each.

Read `sheet` first, then `entries` and `export`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
