"""What an arm reaches of a board, and what a station can do.

Read `reachability` first, then `station_check`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
