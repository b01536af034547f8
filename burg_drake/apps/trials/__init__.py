"""`burg-drake trials`: grasps tried on the robot, from their choice to the last entry.

`verbs` comes first and adds the other modules, one a verb; the page of `trials serve` is in
`lab_page`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
