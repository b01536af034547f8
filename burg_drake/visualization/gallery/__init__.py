"""Libraries and grasp frames laid out side by side.

Read `library` first, then `layout`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
