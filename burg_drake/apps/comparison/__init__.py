"""`burg-drake compare` and `burg-drake gap`: simulated outcomes beside real ones.

`compare` comes first; `rejudge` is an option of it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
