"""How much a grip bears: tugs, less friction, poses that are not quite right.

Read `hold_force` and `perturbation` first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
