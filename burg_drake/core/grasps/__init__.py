"""Sets of grasps, what can become of a grasp, and what columns mean.

Read `grasp_set`, `outcome` and `verdict` first, then `columns`; `verdict_field` says how verdicts
are written, `storage` has the files.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
