"""One run of several: shards, or copies that were interrupted.

Read `runs` first, then `campaigns` for many scenes; `journals` chooses among verdicts.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
