"""Training data: views of scenes as images with labels, in the formats that people train on.

Read `rendering` first, then `samples` and `generating`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
