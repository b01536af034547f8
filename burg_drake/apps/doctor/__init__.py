"""`burg-drake doctor`: what is installed, what is missing for which feature, how to get it.

`verb` has the options and the table; `checks` looks; `packages` tries imports and
knows how this copy of burg_drake gets more.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
