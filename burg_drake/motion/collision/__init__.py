"""Whether postures and motions of the arm are free, by Drake's collision checker.

Read `checker` first, then `edge_checker`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
