"""The grasps that a run judges: sampled here, or given, each with an id.

Read `candidates` first, then `sampling`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
