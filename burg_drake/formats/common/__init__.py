"""What grasp files of other projects have in common.

Read `grasp_format` and `convention` first, then `conversion`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
