"""Pairs of verdicts and of what happened, which comparisons are made of.

Read `side` first, then `matching`, `tried` and `pairs`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
