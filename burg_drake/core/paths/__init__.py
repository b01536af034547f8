"""Where installed data and the files of others are, and how files refer to each other.

Read `resources` first, then `references`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
