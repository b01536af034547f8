"""Free motions from home to the postures in which the straight parts begin.

Read `home_tree` first, then `roadmap`; `goal_search` is the last resort.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
