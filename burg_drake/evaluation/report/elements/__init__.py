"""The parts that sections of reports are made of: blocks, charts, drawings.

Read `blocks` first; `page_frame` makes a page of them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
