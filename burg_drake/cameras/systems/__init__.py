"""Estimator, filter, overlay and sources of frames as systems of Drake.

Read `board_loop` first, which connects them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
