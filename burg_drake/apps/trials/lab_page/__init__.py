"""The page of `burg-drake trials serve`, on which trials are entered as they are carried out.

`server` comes first; `entry_requests` reads what browsers send.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
