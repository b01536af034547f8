"""A scene, a station or a trial in Meshcat.

Read `scene` first, then `replay`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
