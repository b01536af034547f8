"""Data sets by the thousand: recipe, work in several processes, card."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
