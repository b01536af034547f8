"""Who may open a page, and what browsers may send.

Read `door` first, then `guarded_viser` and `admission`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
