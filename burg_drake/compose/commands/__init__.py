"""The steps that a session can take, each one undone as a whole.

Read `command` first; the other modules have the commands by what they change.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
