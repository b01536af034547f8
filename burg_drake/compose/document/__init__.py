"""What a session holds: scene, library and selection, their history, and what is wrong with them.

Read `state` first, then `history` and `checker`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
