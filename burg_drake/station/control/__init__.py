"""Drivers, controllers and measurements of a robot as systems of Drake.

Read `ports` first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
