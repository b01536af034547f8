"""Images of a scene: colours by a renderer, depth, labels and normals by rays."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
