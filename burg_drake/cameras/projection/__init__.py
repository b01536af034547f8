"""What a camera sees of a scene's meshes: contours, creases and hidden parts, by rays.

Read `scene_mesh` and `line_drawing`; `visibility` says how much of each object is seen.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
