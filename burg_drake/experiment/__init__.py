"""Trials on the real robot beside simulated ones: choice, records, comparison, the gap.

`trials`: the trials file, its journal, and the choice of grasps. `lab`: pages and pictures for the
operator. `comparison`: runs against trials, or against each other. `gap`: the steps in which
simulation and reality part. `trials` imports none of the others, `comparison` only `trials`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
