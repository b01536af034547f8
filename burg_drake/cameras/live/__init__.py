"""A session that looks at every frame of a camera, draws the scene over it and measures.

Read `session` first, then `frame_processing`; `actions` has what viewers can ask for: snapshots and
recordings.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
