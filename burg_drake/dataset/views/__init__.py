"""Cameras around a scene: on a sphere, those of the station with jitter, and on the wrist."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
