"""Scene documents: objects and their poses on the board, and checks of these.

Read `scene_document` first; `scene_validation` checks where objects stand, `arrangement` finds
room for them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
