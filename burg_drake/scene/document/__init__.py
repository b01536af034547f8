"""The scene document with its board and markers, and the recipe of sampled scenes.

Read `scene`, `board` and `markers` first, then `validation`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
