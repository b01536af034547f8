"""`burg-drake grasps`: sampling, scoring, showing, comparing and exchanging files of grasps.

`verbs` comes first and adds the other modules, one a verb; `source` and `shown_grasps` serve
several.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
