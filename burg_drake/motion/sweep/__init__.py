"""What hand and target meet on their straight paths, before any arm is asked.

Read `hand_sweep` first, then `target_sweep`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
