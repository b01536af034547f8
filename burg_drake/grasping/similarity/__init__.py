"""How far apart grasps are, the nearest ones of a set, and diverse subsets.

Read `pose_distance` first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
