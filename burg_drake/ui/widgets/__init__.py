"""What panels are made of, and the one queue that all actions go through.

Read `action_queue` and `page_actions` first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
