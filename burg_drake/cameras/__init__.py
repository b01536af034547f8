"""Cameras: intrinsics, the board's pose from an image, overlay, placement check, image sources."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
