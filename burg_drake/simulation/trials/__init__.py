"""Grasp trials, by the floating hand or the whole arm.

Read `hand_trial` and `arm_trial`, which share `grasp_trial`; `execution` runs the phases with a
`carrier`, and `result` is what comes of it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
