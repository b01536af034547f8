"""The main job on the command line: `evaluate` and `reach`, and what is done with their runs.

`evaluate` comes first, with `campaign` for several scenes; each other module is a verb.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
