"""Builds object libraries: repaired, decomposed, confirmed in simulation, cached, checked.

Read `object_source` first, then `library_build` and `object_build`; `library_recipe` reads the
recipe, which lists the objects to build.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
