"""Mass properties of objects and how they come to rest.

Read `mass` and `stability` first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
