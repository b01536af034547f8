"""What the page shows of a scene in three dimensions.

Read `board` and `objects` first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
