"""`burg-drake scene`, `printout` and `setup`: scenes made, checked, printed and converted.

`verbs` comes first and adds the other modules, one a verb.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
