"""Inverse kinematics: closed form for the Panda, numeric for others, or one's own.

Read `routine` and `solutions` first; `limits` says how fast joints may move.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
