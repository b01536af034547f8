"""`burg-drake render` and `burg-drake dataset`: images of scenes, one or many."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
