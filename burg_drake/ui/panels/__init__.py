"""The panels of the setup page, a module each.

Read `object` as an example.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
