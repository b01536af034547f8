"""`burg-drake ar`: the scene drawn over a camera's picture, live in a browser or in a script.

`verb` has the options; `server` serves the view, and `session_status` is what its page is told.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
