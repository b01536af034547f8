"""Time stepping: grasp trials with their outcome and margins, and scenes that come to rest.

Read `trials` first; `settling` builds on `rest`, and `robustness` repeats trials.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
