"""Scenes and single objects brought to rest, on the board.

Read `settled_scene` first, then `drop_test` and `resting_poses`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
