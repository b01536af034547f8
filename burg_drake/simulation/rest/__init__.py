"""Whether and where objects come to rest, and how close to each other they stand.

Read `criterion` first, then `relaxation` and `drift`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
