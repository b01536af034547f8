"""The printable board: height map of a scene, markers at true scale, pages.

Read `board_printout` first; it goes from `relief` over `sheet` to `tiling`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
