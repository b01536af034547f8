"""Sets of grasps, what their columns mean, and what can become of a grasp.

Read `grasp_set` and `outcome` first, then `columns`; `storage` has the files.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
