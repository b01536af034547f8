"""Shared code of all rooms: frames, documents, grasp sets, verdicts, workers; without Drake.

Read `frames` and `errors` first; then `documents` and `grasp_set`, which define the project's
files.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
