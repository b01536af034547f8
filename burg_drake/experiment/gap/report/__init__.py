"""What is said about the gap: a page, sections of pages, tables for terminals.

Read `page` first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
