"""Statistics of judges: agreement with what happened, intervals, ranking, paired tests.

Read `confusion` and `estimates` first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
