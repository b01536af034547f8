"""The board's pose and the overlay for robots that run ROS 1 or ROS 2.

Read `board_node` first, then `loop`. All but two modules (`ros1`, `ros2`) know messages only as
objects with fields, and neither imports ROS nor cv_bridge, whose compiled part is bound to one
version of OpenCV and numpy.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
