"""Exact geometry of convex shapes in batches, without Drake: distances, overlaps, rays.

Read `convex_shapes` first, then `convex_distance` and `bodies`; `hand_screen` uses them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
