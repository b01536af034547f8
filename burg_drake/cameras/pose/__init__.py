"""Where a camera is over the printed board, by the edges of all markers.

Read `estimator` first; it goes from `detection` over `coarse` to `refinement`, and
`camera_location` averages over images.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
