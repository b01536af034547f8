"""Scenes by the thousand: drawn from a recipe, settled, accepted or not, kept in a folder.

Read `scene_sampling` first, then `scene_folder`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
