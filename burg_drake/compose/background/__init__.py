"""What goes on beside the editing in a process of its own: settling, counting grasps.

Read `process` first; a task is what it is given, and the newest one replaces the others.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
