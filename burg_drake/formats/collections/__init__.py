"""Libraries and scenes of other projects: BURG-Toolkit's, and the YCB object set.

The modules stand for themselves.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
