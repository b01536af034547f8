"""Sets of grasps compared: coverage, rankings, average precision.

Read `matching` and `summary` first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
