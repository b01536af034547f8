"""Meshes to sim-ready objects: repair, mass properties, convex pieces, SDF, stable poses.

Read `library` first, which has what is known of an object in the end; `meshes`, `physics` and
`collision` compute it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
