"""The board's pose and the overlay for robots that run ROS 1 or ROS 2.

Read `board_node` first, then `loop`. All modules but `node_implementations` know messages only as
objects with fields, and none imports cv_bridge, whose compiled part is bound to one version of
OpenCV and numpy.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
