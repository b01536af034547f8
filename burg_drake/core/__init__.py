"""What all rooms need: frames, documents, grasp sets, verdicts, workers; nothing needs Drake.

Read `frames` and `errors` first; then `documents` and `grasp_set`, which the project's files are
made of.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
