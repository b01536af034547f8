"""`burg-drake library`: building, checking and showing object libraries.

`verbs` has the options; `building` and `viewing` run them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
