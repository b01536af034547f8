"""Colours, legends and HTML elements of pages.

Read `palette` and `markup` first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
