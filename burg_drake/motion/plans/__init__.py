"""Timed motions of an arm, and the files that hold them.

Read `trajectory` and `planned_motion` first, then `grasp_plan`; JSON and CSV share `plan_record`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
