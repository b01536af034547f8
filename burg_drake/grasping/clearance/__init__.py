"""The screen of the open hand against a scene, with the geometry that Drake has.

Read `hand_clearance` first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
