"""Scenes as documents of simulators: SDFormat, Drake's model directives, MJCF, USD.

Read `scene_export` first, then `layout`, which all formats write.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
