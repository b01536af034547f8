"""The page of a comparison, in the style of the report of a run.

Read `page` first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
