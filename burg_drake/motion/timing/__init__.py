"""Time for paths, within the limits of joints, and straight where the hand goes straight.

Read `grasp_timing` first; it rests on `cubics`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
