"""The straight parts of a grasp's motion as chains of postures.

Read `line_search` and `line_poses` first, then `closed_form` and `numeric_search`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
