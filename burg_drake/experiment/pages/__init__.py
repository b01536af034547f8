"""Pages for the lab: the protocol of trials on paper, and pictures of their grasps.

Read `protocol` first, then `trial_pictures`, which has two painters.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
