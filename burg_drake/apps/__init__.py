"""The command line and the local web pages.

`cli` lists the commands. Their modules in `commands` parse options, call the library and print the
results; they share `options` and `terminal`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
