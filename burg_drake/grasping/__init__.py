"""Grasps without time stepping: sampled, screened, scored and compared.

`sampling` and `clearance` are on the main road; `similarity` is what `comparison` rests on.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
