"""The object library: its document, its entries and the files that it writes.

Read `entry` and `document` first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
