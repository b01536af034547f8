"""Scene documents: which objects stand where on the board, and whether they can.

Read `document` first; `arrangement` finds room for objects.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
