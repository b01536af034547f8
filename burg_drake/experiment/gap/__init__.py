"""Where simulation and reality part: real trials judged again, and one cause after the other.

Read `measurement` and `steps` first, then `rejudging`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
