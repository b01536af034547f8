"""Whether scenes can stand on a station, and how far objects can be moved there.

Read `scene_issues` first; `scene_check` answers again and again while a scene changes.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
