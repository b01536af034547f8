"""Intrinsics of a camera from images of a ChArUco board, and how far they can be trusted.

Read `target`, `estimation`, `lens_choice` and `lens_fit`, then `lens_uncertainty`, `promise` and
`guidance`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
