"""Pages in the browser, on viser; whatever they do is a command of a session in `compose`.

Read `setup_page` first; `panels` stand beside the `view`, both are made of `widgets`, and `server`
decides who comes in.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
