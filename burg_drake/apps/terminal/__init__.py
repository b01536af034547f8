"""What verbs show in a terminal, and how those end that run until they are interrupted.

The modules stand for themselves.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
