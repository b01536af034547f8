"""Intrinsics and lens distortion, and the files that hold them.

Read `intrinsics` first, then `intrinsics_file`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
