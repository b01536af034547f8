"""What goes into Meshcat: meshes, text, hands, and where its eye is.

The modules stand for themselves.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
