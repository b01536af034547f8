"""How sure the verdict of a trial is: from its margins to a probability.

Read `calibration` first, then `grip_signs`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
