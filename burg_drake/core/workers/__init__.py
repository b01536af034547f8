"""Worker processes of this machine.

Read `processes` first, upon which the others build.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
