"""Photos of the board as its top view, true to scale.

Read `top_view` first; `sheet_fit` does without intrinsics, and `stream` goes on.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
