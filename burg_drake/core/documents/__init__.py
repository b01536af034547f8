"""Typed, versioned documents in YAML, and JSON; whatever is wrong is named with file and line.

Read `schema` first, then `reader`; the other modules read text within bounds.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
