"""Reproducible robot-grasping scenes and reachability-aware grasp evaluation on Drake.

The names are listed in `__init__.pyi`, which type checkers read; each is imported from its room on
first use, so that importing the package stays instantaneous.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
