"""Meshes read, scaled, repaired and closed.

Read `surface` first, which puts the others to use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
