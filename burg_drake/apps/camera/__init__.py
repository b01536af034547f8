"""`burg-drake camera`: finding, calibrating and placing cameras, and checking photos.

`verbs` comes first and adds the other modules, one a verb.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
