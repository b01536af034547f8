"""Whether the arm can execute a grasp all the way, and what hinders it if it cannot.

Read `arm_reach` and `verdict` first, then `attempt`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
