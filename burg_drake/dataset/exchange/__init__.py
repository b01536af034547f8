"""Data sets in the formats of others, their card and contact sheet.

Read `source` first, which says what a data set is here, then `bop`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
