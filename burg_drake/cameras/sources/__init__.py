"""Where images come from: cameras, videos, photos, streams and simulated cameras.

Read `frame` first, then `opening`, which finds the source for a name.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
