"""How one grasp is judged: by the hand's clearance, the arm's reach, a trial.

Read `judge` first, then `station_judge`, whose first stages are in `screening`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
