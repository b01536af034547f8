"""How scenes become runs: prepared, judged and finished, one or many at a time.

Read `request` and `preparation` first, then `many_scenes`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
