"""A session's scene on the disk: its file, its lock and the journal that survives a crash.

Read `scene_storage` first, then `opening`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
