"""Meshes to sim-ready objects: repair, mass properties, convex pieces, SDF, stable poses.

Read `library` first, which defines the entry of a finished object. `mesh_loading`, `mass`,
`resting_poses`, `convex_decomposition` and `contact` compute it.
"""

import lazy_loader

__getattr__, _, _ = lazy_loader.attach_stub(__name__, __file__)

__all__ = [
    "ContactGeometry",
    "Decomposition",
    "Fit",
    "LibraryDocument",
    "MassProperties",
    "ObjectEntry",
    "Primitive",
    "Source",
    "StablePose",
    "unit_scale",
]


def __dir__() -> list[str]:
    return __all__
