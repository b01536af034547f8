"""What of an object touches others in simulation: a primitive, convex pieces, or the mesh.

Read `contact` first; `fit` says how well it stands for the object.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
