"""Judges on their way to other machines, with all files that Drake reads.

Read `bundle` first, then `bundled_judge` and `judge_recipe`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
