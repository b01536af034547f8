"""The sections of the report, a module or so each.

`opening` and `cascade` come first in the page, `reproduction` last.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
