"""The first page of a printout: how the board is printed, assembled, lit, seen and used.

`sketches` has the pictures, `steps` what is said beside them, and `pages` puts both on paper.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
