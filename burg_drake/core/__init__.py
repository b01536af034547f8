"""The ground floor: what all rooms need, and nothing that needs Drake.

Read `frames` and `errors` first; then `documents` and `grasps`, which the project's files are made
of.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
