"""What terminals show: tables, numbers, colours, and how far a job is.

Read `progress` first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
