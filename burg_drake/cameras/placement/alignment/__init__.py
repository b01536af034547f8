"""One object aligned with an image: by its outline in a photo, or by its surface in a depth image.

Read `aligner`, then `silhouette_aligner` and `depth_aligner`; `least_squares` fits.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
