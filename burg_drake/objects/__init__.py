"""Meshes to sim-ready objects: repair, mass properties, convex pieces, SDF, stable poses."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
