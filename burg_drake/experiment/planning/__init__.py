"""Grasps of runs chosen for trials on the robot, and what these trials will tell.

Read `plan` first, then `selection` and `power`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
