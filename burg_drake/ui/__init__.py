"""Pages in the browser, on viser; whatever they do is a command of a session in `compose`."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
