"""Quick bounds on the clearance of an arm in a scene, for thousands of postures at a time.

Read `clearance_bounds` first; the robot is a `ball_tree`, the world a `distance_field`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
