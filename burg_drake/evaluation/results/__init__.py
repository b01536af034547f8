"""What a run found, in numbers: counts and shares, its best grasps, how far it is.

Read `summary` first, then `counts`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
