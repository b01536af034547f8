"""Grasps from files and runs as sets to work on, and what sets say of their origin.

Read `input` first, then `candidate_files`; `sampled` and `scored` make sets.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
