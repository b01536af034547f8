"""Samples scenes in bulk: draws them from a recipe, settles, accepts and stores them in a folder.

Read `scene_sampling` first, then `scene_folder`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
