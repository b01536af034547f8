"""The printable board: height map of a scene, markers at true scale, pages.

Read `board_printout` first: it draws the objects (`object_drawings`), chooses the pages
(`page_tiling`), and writes the sheet and the instructions (`sheet`, `guide`).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
