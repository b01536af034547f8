"""Simulated and real outcomes held against each other.

Read `comparing` and `comparison` first, then `of_trials` and `of_runs`; `judge_assessment` has the
figures.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
