"""Still pictures and pages of pictures, without a browser that steps a scene.

The modules stand for themselves.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
