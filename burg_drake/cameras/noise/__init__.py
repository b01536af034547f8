"""Depth images as depth cameras measure them: what they add, move and lose.

Read `document` first, which has all figures, then `measurement`, which applies the effects in the
order of what happens in a camera; the other modules have one kind of effect each.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
