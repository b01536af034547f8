"""The report of a run as one self-contained HTML page.

Read `page` first, or `campaign` for many scenes; `sections` are put together of `elements`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
